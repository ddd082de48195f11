# SPDX-License-Identifier: BSD-3-Clause
"""Compiles the kernels of a package into a shared library, which :mod:`m2wr_node.kernel` loads without numba.

A library has the kernels that Python calls, for the types of arguments that a warm-up of the package calls them with.
numba's ahead-of-time compiler makes it (``numba.pycc``; tried with numba 0.56, 0.58 and 0.68).  Where that compiler, a
C compiler or Python's header files are missing, there is no library, and numba compiles at run time.
"""
from __future__ import annotations

import importlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from typing import Any, Callable, Dict, List, Set, Tuple

from m2wr_node import kernel
from m2wr_node.kernel_progress import KernelProgress, kernels


class NoLibraryError(Exception):
    """A library cannot be made; the message says why."""


def prepare(package: str, compile_kernels: Callable[[], None]) -> None:
    """Compile the kernels of a package into numba's cache, then into a library; print the progress.

    Parameters
    ----------
    package : str
        Name of the Python package.
    compile_kernels : callable
        The function of that name in the package's module ``kernel_warm_up``.
    """
    with KernelProgress(package):
        compile_kernels()
    print("   " + update(package))


def update(package: str) -> str:
    """Compile the library of a package if it is missing, damaged or out of date.

    Call the warm-up before, which fills numba's cache.  Otherwise the library also has the kernels that only other
    kernels call, which makes it larger.

    Parameters
    ----------
    package : str
        Name of the Python package.  The function ``compile_kernels()`` of its module ``kernel_warm_up`` calls every
        kernel that Python calls.

    Returns
    -------
    str
        What was done, for the terminal.
    """
    if not kernel.is_wanted():
        return "%s: no library of kernels, by the environment" % package
    if kernel.loaded(_source_folder(package)) is not None:
        return "%s: the library of kernels is up to date" % package
    environment = dict(os.environ)
    environment[kernel.SWITCH] = "0"
    made = subprocess.run([sys.executable, "-m", __name__, package], env=environment, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    last = (made.stdout.strip().splitlines() or ["no output"])[-1]
    if made.returncode:
        return "%s: no library of kernels, numba compiles at run time: %s" % (package, last)
    return "%s: %s" % (package, last)


def _source_folder(package: str) -> str:
    """Return the folder with the sources of a package. Its name leads to a relay in devel/ instead."""
    return kernel.package_folder(next(iter(kernels(package).values())).py_func)


def _sources(package: str) -> Dict[str, str]:
    """Return checksums of a package and of those whose kernels it calls, by folders relative to that of the package."""
    own = _source_folder(package)
    folders = {own}
    for found in kernels(package).values():
        for used in found.py_func.__globals__.values():
            function = getattr(used, "py_func", None)
            if function is not None:
                folders.add(kernel.package_folder(function))
    return {os.path.relpath(folder, own): kernel.checksum(folder) for folder in sorted(folders)}


def compile_library(package: str) -> int:
    """Call the warm-up, then compile each kernel that was called for the types of its arguments.

    Parameters
    ----------
    package : str
        Name of the Python package.

    Returns
    -------
    int
        Number of compiled kernels, counted once per combination of types.

    Raises
    ------
    NoLibraryError
        If this installation cannot compile a library.
    """
    importlib.import_module(package + ".kernel_warm_up").compile_kernels()
    wanted = {name: list(found.nopython_signatures) for name, found in kernels(package).items()}
    folder = _source_folder(package)
    library, description = kernel.paths(folder)
    os.makedirs(os.path.dirname(library), exist_ok=True)
    temporary = tempfile.mkdtemp(prefix=".kernels-", dir=os.path.dirname(library))
    try:
        about = _compile(package, wanted, temporary)
        about["sources"] = _sources(package)
        os.chmod(os.path.join(temporary, os.path.basename(library)), 0o644)
        with open(os.path.join(temporary, "about.json"), "w") as stream:
            json.dump(about, stream)
        if os.path.exists(description):
            os.remove(description)              # never an old description beside a new library
        os.replace(os.path.join(temporary, os.path.basename(library)), library)
        os.replace(os.path.join(temporary, "about.json"), description)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return sum(map(len, about["kernels"].values()))


def _compile(package: str, wanted: Dict[str, List[Any]], folder: str) -> Dict[str, Any]:
    """Compile a library in a folder; return its description."""
    described: Dict[str, List[Tuple[str, List[Any]]]] = {}
    functions, fast, left_out = {}, set(), set()
    for name, found in kernels(package).items():
        functions[name] = found.py_func
        if found.targetoptions.get("fastmath"):
            fast.add(found.py_func)
    compiler = _compiler(package, folder, fast)
    for name, signatures in wanted.items():
        for signature in signatures:
            types = [type_of(argument) for argument in signature.args]
            if None in types:
                left_out.add(name)
                continue
            symbol = "kernel_%d" % sum(map(len, described.values()))
            compiler.export(symbol, signature)(functions[name])
            described.setdefault(name, []).append((symbol, types))
    try:
        compiler.compile()
    except Exception as error:                  # of distutils, of the linker or of numba, by version
        raise NoLibraryError("%s: %s" % (type(error).__name__, error)) from error
    return {"kernels": described, "left_out": sorted(left_out - set(described))}


def _compiler(package: str, folder: str, fast: Set[Callable[..., Any]]) -> Any:
    """Return numba's ahead-of-time compiler, which uses the same options as the one at run time.

    ``fast`` are the functions whose sums may be reordered.
    """
    try:
        from numba.core.codegen import AOTCPUCodegen
        from numba.core.compiler import Flags, compile_extra
        from numba.core.cpu_options import FastMathOptions
        from numba.pycc import CC, compiler
    except ImportError as error:
        raise NoLibraryError("this numba has no ahead-of-time compiler (%s)" % error) from error

    def flags() -> Any:
        """Return flags that release the interpreter's lock and divide by zero as NumPy does."""
        found = Flags()
        found.release_gil = kernel.OPTIONS["nogil"]
        found.error_model = kernel.OPTIONS["error_model"]
        return found

    def compiled(typing: Any, target: Any, function: Any, arguments: Any, result: Any, flags: Any, **more: Any) -> Any:
        """Compile one function."""
        if function in fast:
            flags = flags.copy()
            flags.fastmath = FastMathOptions(True)
        return compile_extra(typing, target, function, arguments, result, flags, **more)

    # numba offers no parameters for these.  For a processor that LLVM does not know, the name "host" alone would
    # give code for the oldest one.
    compiler.Flags, compiler.compile_extra = flags, compiled
    AOTCPUCodegen._customize_tm_features = AOTCPUCodegen._get_host_cpu_features
    made = CC(kernel.module_name(package), source_module=sys.modules[__name__])
    made.output_dir, made.target_cpu = folder, "host"
    return made


def type_of(argument: Any) -> Any:
    """Return a description of numba's type of an argument, None if a library does not support it.

    It is a scalar's name, [dtype, dimensions, order] of a contiguous array, or ["tuple", scalar's name, ...].
    """
    from numba import types
    if isinstance(argument, types.Array):
        plain = argument.layout in "CF" and argument.mutable and argument.aligned
        return [str(argument.dtype), argument.ndim, argument.layout] if plain else None
    if isinstance(argument, (types.UniTuple, types.Tuple)):
        parts = [type_of(part) for part in argument.types]
        return ["tuple", *parts] if all(isinstance(part, str) for part in parts) else None
    return str(argument) if str(argument) in kernel.SCALARS else None


if __name__ == "__main__":
    try:
        print("a library of %d kernels compiled" % compile_library(sys.argv[1]))
    except (NoLibraryError, OSError) as failure:
        sys.exit(str(failure))
