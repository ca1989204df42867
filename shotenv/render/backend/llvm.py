"""Which LLVM library Dr.Jit would load, found and judged before the first kernel can abort.

Dr.Jit compiles its kernels with an LLVM shared library of the machine. LLVM 15 ends the process
on processors with AVX-512 ("Cannot select: fmaximum"), so nothing older than 16 is let through.
"""

from __future__ import annotations

import ctypes
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

OLDEST_LLVM = 16
LIBRARY_VARIABLE = "DRJIT_LIBLLVM_PATH"
CURE = "install one with: apt-get install libllvm19"
VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")
VARIANT_VARIABLE = "SHOTENV_MITSUBA_VARIANT"
_FOLDERS = (
    "/usr/lib",
    "/usr/lib64",
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
    "/usr/local/lib",
    "/usr/lib/llvm-*/lib",
    "/opt/homebrew/opt/llvm/lib",
    "/usr/local/opt/llvm/lib",
)


class RendererError(RuntimeError):
    """Rendering cannot start or go on; the message says in one sentence why and what to do."""


def find_llvm() -> tuple[str, int] | None:
    """Path and major version of the LLVM library that Dr.Jit is to load, or None.

    The file named by `DRJIT_LIBLLVM_PATH` where that is set, else the newest one on the machine.
    No kernel is started; a file that is no LLVM library has version 0.
    """
    named = os.environ.get(LIBRARY_VARIABLE)
    if named:
        return named, llvm_version(named)
    # By name first: to load one library only to ask its version takes up to a fifth of a second.
    found = {path: _version_in_name(path) for path in _candidates()}
    for path in sorted(found, key=lambda path: found[path], reverse=True):
        version = llvm_version(path)
        if version:
            return path, version
    return None


def require_llvm() -> tuple[str, int]:
    """`find_llvm`, with `DRJIT_LIBLLVM_PATH` set to the library so that Dr.Jit loads no other.

    Raises
    ------
    RendererError
        There is no LLVM library, or it is older than version 16.
    """
    found = find_llvm()
    if found is None:
        raise RendererError(f"no LLVM library was found, and Mitsuba needs one; {CURE}")
    path, version = found
    if version == 0:
        raise RendererError(f"{path} cannot be loaded as an LLVM library; {CURE}")
    if version < OLDEST_LLVM:
        raise RendererError(
            f"{path} is LLVM {version}, which can abort the process, and Mitsuba needs "
            f"{OLDEST_LLVM} or newer; {CURE}"
        )
    os.environ[LIBRARY_VARIABLE] = path
    return found


def llvm_version(path: str) -> int:
    """Major version that the library at `path` reports itself; 0 where it is no LLVM library.

    Libraries older than LLVM 16 have no `LLVMGetVersion`; their version is read from the name.
    """
    try:
        library = ctypes.CDLL(path)
        library.LLVMContextCreate  # noqa: B018 - every libLLVM exports it
    except (OSError, AttributeError):
        return 0
    try:
        major = ctypes.c_uint()
        library.LLVMGetVersion(ctypes.byref(major), None, None)
        return major.value
    except AttributeError:
        # 1 where the name has no version: it is LLVM, and too old whatever it is.
        return min(_version_in_name(str(Path(path).resolve())), OLDEST_LLVM - 1) or 1


def chosen_variant() -> str:
    """Variant named by `SHOTENV_MITSUBA_VARIANT`, else LLVM.

    Raises
    ------
    RendererError
        The variable names no variant that we render with.
    """
    named = os.environ.get(VARIANT_VARIABLE) or VARIANTS[0]
    if named not in VARIANTS:
        expected = ", ".join(VARIANTS)
        raise RendererError(f"{VARIANT_VARIABLE} is {named!r}; expected one of {expected}")
    return named


def require_device() -> None:
    """Refuse to render where the chosen variant lacks what it needs, as far as a look can tell.

    Raises
    ------
    RendererError
        See `chosen_variant` and `require_llvm`.
    """
    if chosen_variant() == "llvm_ad_mono":
        require_llvm()


def start_mitsuba(variant: str | None = None) -> Any:
    """The mitsuba module with its variant set: the one place that does so.

    `variant` is `llvm_ad_mono`, `cuda_ad_mono` or None: the one already set, else the one that
    `chosen_variant` gives.

    Raises
    ------
    RendererError
        Mitsuba is not installed, or the variant cannot run on this machine.
    ValueError
        An unknown variant.
    """
    if variant is not None and variant not in VARIANTS:
        raise ValueError(f"variant is {variant!r}; expected one of {', '.join(VARIANTS)}")
    try:
        import drjit
        import mitsuba
    except ImportError as error:
        raise RendererError(
            f"rendering needs Mitsuba ({error}); install it with: pip install 'shotenv[render]'"
        ) from None
    if variant is None and mitsuba.variant() in VARIANTS:
        return mitsuba
    chosen = variant or chosen_variant()
    if chosen == "llvm_ad_mono":
        require_llvm()
    elif not drjit.has_backend(drjit.JitBackend.CUDA):
        raise RendererError(f"{chosen} needs an NVIDIA GPU with its driver, and none was found")
    mitsuba.set_variant(chosen)
    return mitsuba


def limit_threads(threads: int) -> None:
    """Let kernels of this process run on so many threads."""
    try:
        import drjit
    except ImportError:
        return  # The first job that renders says so in a better way.
    drjit.set_thread_count(threads)


def _candidates() -> Iterator[str]:
    yield from re.findall(r"=> (\S*libLLVM\S*)", _ldconfig())
    for pattern in _FOLDERS:
        for folder in Path("/").glob(pattern.lstrip("/")):
            yield from (str(path) for path in folder.glob("libLLVM*.so*"))
            yield from (str(path) for path in folder.glob("libLLVM.dylib"))


def _ldconfig() -> str:
    for command in ("ldconfig", "/sbin/ldconfig"):
        try:
            done = subprocess.run([command, "-p"], capture_output=True, text=True, timeout=10)
        except (OSError, subprocess.TimeoutExpired):
            continue
        return done.stdout
    return ""


def _version_in_name(path: str) -> int:
    """19 of `libLLVM-19.so` or `libLLVM.so.19.1`, else 0."""
    match = re.search(r"libLLVM(?:-|\.so\.)(\d+)", Path(path).name)
    return int(match.group(1)) if match else 0
