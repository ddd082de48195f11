# SPDX-License-Identifier: BSD-3-Clause
"""The hook that setup.sh sources: what it adds to PYTHONPATH, and what it keeps."""
import os
import shutil
import subprocess
from pathlib import Path

import pytest

TEMPLATE = Path(__file__).resolve().parents[1] / 'env-hooks' / '50.workspace_venv.sh.in'
SHELLS = [shell for shell in ('sh', 'bash', 'zsh') if shutil.which(shell)]


@pytest.fixture
def site(tmp_path):
    """A site-packages folder; the blank in its path must not split it."""
    path = tmp_path / 'a work space' / '.venv' / 'site-packages'
    path.mkdir(parents=True)
    return str(path)


def pythonpath_after(shell, hook_text, before, times=1):
    """Source the hook some times in a shell that stops at unset variables; return PYTHONPATH as a list, or None."""
    script = 'set -eu\n' + hook_text * times + '\nprintf "%s" "${PYTHONPATH-unset}"\n'
    env = {key: value for key, value in os.environ.items() if key != 'PYTHONPATH'}
    if before is not None:
        env['PYTHONPATH'] = before
    out = subprocess.run([shell, '-c', script], env=env, check=True, stdout=subprocess.PIPE, universal_newlines=True)
    return None if out.stdout == 'unset' else out.stdout.split(':')


def hook(site):
    text = TEMPLATE.read_text()
    assert '@WORKSPACE_VENV_SITE@' in text
    return text.replace('@WORKSPACE_VENV_SITE@', site)


@pytest.mark.parametrize('shell', SHELLS)
class TestHook:
    def test_appends_behind_what_is_there(self, shell, site):
        assert pythonpath_after(shell, hook(site), '/one:/two') == ['/one', '/two', site]

    @pytest.mark.parametrize('before', [None, ''])
    def test_leaves_no_empty_entry(self, shell, site, before):
        """An empty entry would mean the current folder."""
        assert pythonpath_after(shell, hook(site), before) == [site]

    def test_adds_once_however_often_it_is_sourced(self, shell, site):
        assert pythonpath_after(shell, hook(site), '/one', times=3) == ['/one', site]

    def test_a_longer_path_is_not_taken_for_the_venv(self, shell, site):
        assert pythonpath_after(shell, hook(site), site + '2') == [site + '2', site]

    @pytest.mark.parametrize('before', [None, '/one'])
    def test_a_missing_venv_changes_nothing(self, shell, site, before):
        expected = None if before is None else [before]
        assert pythonpath_after(shell, hook(site + '/missing'), before) == expected
