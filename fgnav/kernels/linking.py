"""Linking of kernels: functions that only kernels call become machine code within these alone.

numba does both for each function of a call tree, with all below it, and again within each function
that calls it: two thirds of the work of LLVM. Here code without an entry from Python is linked as
it is, until someone asks for its address.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.environment import lookup_environment

_ENTRY = "_ZN7cpython"  # begins the name of a function's entry from Python
_ENVIRONMENT = "_ZN08NumbaEnv"  # and that of a pointer to its globals
_executable = CPUContext.get_executable


class _LinkedLibrary(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """Code of a function; raw if it was linked alone."""

    is_raw = False

    def finalize(self) -> None:
        """Link what is called; optimise all of it if there is an entry."""
        self.is_raw = not any(f.name.startswith(_ENTRY) for f in self._final_module.functions)
        super().finalize()

    def _optimize_final_module(self) -> None:
        if not self.is_raw:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self.is_raw:
            self._finalized = True
        else:
            super()._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of machine code, made now if it was not."""
        self._ensure_finalized()
        if self.is_raw:
            self.is_raw = False
            self._optimize_final_module()
            self._finalize_final_module()
        address: int = super().get_pointer_to_function(name)
        return address


def _executable_if_entered(context: Any, library: Any, function: Any, env: Any) -> object:  # noqa: ANN401
    """Return the entry point that Python calls; of raw code a name for it that leads nowhere."""
    library._ensure_finalized()
    if library.is_raw:
        module = function.lookup_module()
        return _dynfunc.make_function(module, function.qualname, "", 0, env, (library,))
    entered: object = _executable(context, library, function, env)
    for variable in library._final_module.global_variables:
        if variable.name.startswith(_ENVIRONMENT):
            called = lookup_environment(variable.name)
            if called is not None:
                library.codegen.set_env(variable.name, called)
    return entered


@contextmanager
def linked_once() -> Iterator[None]:
    """Return a context in which callees are linked alone, and which no other thread enters."""
    with global_compiler_lock:
        usual = JITCPUCodegen._library_class, CPUContext.get_executable
        JITCPUCodegen._library_class = _LinkedLibrary
        CPUContext.get_executable = _executable_if_entered
        try:
            yield
        finally:
            JITCPUCodegen._library_class, CPUContext.get_executable = usual
