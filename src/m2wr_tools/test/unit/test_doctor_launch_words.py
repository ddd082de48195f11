# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions of launch files, and expressions that are evaluated without executing code."""
import pytest

from m2wr_tools.doctor.launch_words import NOT_KNOWN, Doubtful, Unknown, Words, not_found


def make_words(**arguments):
    words = Words({"here": "/ws/src/here"}.get, {"HOME": "/home/a", "N": "3"}, "/ws/src/here/launch/a.launch")
    words.arguments = arguments
    return words


@pytest.mark.parametrize("text, value", [
    ("a $(arg x) b", "a 1 b"), ("$(find here)/maps", "/ws/src/here/maps"), ("$(env HOME)", "/home/a"),
    ("$(optenv NONE some words)", "some words"), ("$(optenv N 4)", "3"), ("$(dirname)/b", "/ws/src/here/launch/b"),
    ("$(eval arg('x') + 1)", "2"), ("$(eval x == 1 and not y)", "True"),
    ("$(eval find('here') + '/a')", "/ws/src/here/a"),
    ("$(eval optenv('N', '4') + '!')", "3!"), ("$(eval 'a' if y else 'b')", "b"), ("$(eval -x // 2)", "-1"),
    ("$(eval name[0:2].upper())", "RO"), ("$(eval {'a': 'b'}.get(name, 'c'))", "c"), ("$(eval 0 < x <= 1)", "True"),
    ("$(eval ' '.join(w for w in name.split('b') if w))", "ro ot"), ("$(eval name in ['robot'])", "True")])
def test_a_text_has_its_value(text, value):
    assert make_words(x="1", y="false", name="robot").resolve(text) == value


@pytest.mark.parametrize("text", [
    "$(eval __import__('os').system('x'))", "$(eval open('/etc/passwd'))", "$(eval ''.__class__)", "$(eval 9**9**9)",
    "$(eval 'a' * 10**9)", "$(eval lambda: 1)", "$(eval 1 / 0)", "$(eval 'abc')[", "$(command ls)", "$(eval (1)",
    "$(eval 'a'.replace('', 'b' * 3))", "$(eval '%1000000000d' % 1)", "$(eval " + "(" * 500 + ")",
    "$(eval '{:>1000000000}'.format(1))", "$(eval 'a'.ljust(1000000000))"])
def test_what_is_no_plain_expression_is_not_evaluated(text):
    if text == "$(eval 'abc')[":
        assert make_words().condition(text) is None
    else:
        with pytest.raises(Unknown):
            make_words().resolve(text)


def test_missing_packages_and_values_are_noted():
    words = make_words(given="1", none=None, doubtful=NOT_KNOWN)
    assert not_found(words.resolve("$(find gone)/a.yaml")) and words.missing == {"gone"}
    for text in ("$(arg none)", "$(env GONE)"):
        with pytest.raises(Unknown):
            words.resolve(text)
    assert words.unset == {"argument none", "environment variable GONE"}
    with pytest.raises(Doubtful):
        words.resolve("$(arg doubtful)")


def test_conditions_are_those_of_roslaunch():
    words = make_words(yes="True", no="0", odd="maybe")
    assert words.condition("$(arg yes)") is True and words.condition("$(arg no)") is False
    assert words.condition("$(arg odd)") is None and words.condition("$(arg gone)") is None
