"""What must be chosen before Numba is imported: where kernels are kept, and the threading layer.

Numba does not notice that a function *called by* a cached function has changed: the stale machine
code is used without a word. So the cache directory is named after a digest of all sources that
kernels are made of, of the Numba and Python versions and of the processor: an edit anywhere in them
simply starts a new one, and other edits need no new compilation.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import platform
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Container, Iterator
from importlib import metadata
from pathlib import Path

DECORATORS = "engine.jit.compile"
"""Module that every module with kernels imports."""

KEPT = 3
"""How many cache directories survive pruning."""

MIN_AGE = 3600.0
"""Cache directories used within this time [s] stay: another run may still be compiling into one."""

SPACE = 64 << 20
"""Directories with less free space [bytes] are passed over: Numba cannot cope with a full disk."""

_IMPORT = re.compile(r"^ *from (multicor_cli[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)
_NAME = re.compile(r"kernels-[0-9a-f]{16}-numba[\w.+]+-[\w.-]+-[0-9a-f]{8}")


def configure_cache() -> Path | None:
    """Set ``NUMBA_CACHE_DIR`` to a directory of kernels compiled from exactly these sources.

    The directory lies in ``$NUMBA_CACHE_DIR`` if the user has set it, else in the user's cache
    directory, else (nothing writable) in the temporary directory. With ``MULTICOR_NO_CACHE=1``
    kernels go to a private directory that is deleted at exit. Returns the directory, or None if
    nothing outlives this process.
    """
    if not _may_keep():
        _announce(_private_directory())
        return None
    name = cache_name()
    for base in _candidates():
        directory = _prepare(base, name)
        if directory is not None:
            _prune(base, keep=name)
            _announce(directory)
            return directory
    _announce(_private_directory())
    return None


def is_compiled(*, has_shapes: bool = False) -> bool:
    """Whether `configure_cache` has found the longest kernel: then most are compiled.

    That of discs, or the one that grains of other shapes need as well.
    """
    directory = os.environ.get("NUMBA_CACHE_DIR", "")
    longest = "face_sweep.relax_faces-*.nbi" if has_shapes else "acceleration.iterate-*.nbi"
    return bool(directory) and next(Path(directory).rglob(longest), None) is not None


def is_kept() -> bool:
    """Whether another process with the same environment finds what is compiled here."""
    return (
        _may_keep()
        and _NAME.fullmatch(Path(os.environ.get("NUMBA_CACHE_DIR", "")).name) is not None
    )


def _may_keep() -> bool:
    return os.environ.get("MULTICOR_NO_CACHE", "") in ("", "0")


def cache_name() -> str:
    """Name of the cache directory of this package, interpreter and processor."""
    compiler, tag = f"numba{metadata.version('numba')}", str(sys.implementation.cache_tag)
    return "-".join(["kernels", _source_digest(), compiler, tag, _processor_digest()])


def kernel_sources(root: Path) -> list[Path]:
    """Modules with kernels below ``root``, the package, and whatever those import from it."""
    found = {}
    for path in root.rglob("*.py"):
        name = ".".join(path.relative_to(root.parent).with_suffix("").parts)
        found[name.removesuffix(".__init__")] = path
    texts = {name: path.read_text(encoding="utf-8") for name, path in found.items()}
    decorators = f"{root.name}.{DECORATORS}"
    imports = {name: set(_imports(text, texts)) for name, text in texts.items()}
    waiting = [name for name, imported in imports.items() if decorators in imported]
    wanted: set[str] = set()
    while waiting:
        name = waiting.pop()
        if name not in wanted:
            wanted.add(name)
            waiting.extend(imports[name])
    return sorted(found[name] for name in wanted)


def _imports(text: str, known: Container[str]) -> Iterator[str]:
    for module, names in _IMPORT.findall(text):
        yield from (
            name
            for name in (module, *(f"{module}.{word}" for word in re.findall(r"\w+", names)))
            if name in known
        )


def _source_digest() -> str:
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.blake2b(digest_size=8)
    for path in kernel_sources(root):
        digest.update(path.relative_to(root).as_posix().encode() + b"\0")
        digest.update(hashlib.blake2b(path.read_bytes()).digest())
    return digest.hexdigest()


def _processor_digest() -> str:
    """Of the name and instruction sets: a home directory may be shared by unlike machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:
        lines = []
    text = sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))})
    return hashlib.blake2b(
        "\n".join([platform.machine(), *text]).encode(), digest_size=4
    ).hexdigest()


def _candidates() -> Iterator[Path]:
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        path = Path(given).absolute()
        # Inherited from a process of ours: its siblings, not a directory inside it.
        yield path.parent if _NAME.fullmatch(path.name) else path
    xdg = os.environ.get("XDG_CACHE_HOME")
    if xdg and Path(xdg).is_absolute():
        yield Path(xdg) / "multicor"
    else:
        home = Path("~").expanduser()
        if home.is_absolute():
            yield home / ".cache" / "multicor"
    yield Path(tempfile.gettempdir()) / f"multicor-{os.getuid()}"


def _prepare(base: Path, name: str) -> Path | None:
    """Create ``base/name``; None if it fails or others could write to it: the cache is code."""
    directory = base / name
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        space = os.statvfs(base)
        if not _is_ours(base) or space.f_bavail * space.f_frsize < SPACE:
            return None  # before anything is left there
        directory.mkdir(mode=0o700, exist_ok=True)
        if not _is_ours(directory) or not os.access(directory, os.R_OK | os.W_OK | os.X_OK):
            return None
        os.utime(directory)
    except OSError:
        return None
    return directory


def _is_ours(path: Path) -> bool:
    info = path.stat()
    shared = bool(info.st_mode & stat.S_IWOTH) and not info.st_mode & stat.S_ISVTX
    return info.st_uid in (os.getuid(), 0) and not shared


def _private_directory() -> Path:
    directory = Path(tempfile.mkdtemp(prefix="multicor-kernels-"))
    atexit.register(shutil.rmtree, directory, ignore_errors=True)
    return directory


def _prune(base: Path, keep: str) -> None:
    """Delete all but the newest caches in ``base``; failing to do so is harmless."""
    found = []
    for path in base.iterdir():
        if _NAME.fullmatch(path.name) and not path.is_symlink():
            try:
                found.append((path.stat().st_mtime, path))
            except OSError:
                continue
    for changed, path in sorted(found, reverse=True)[KEPT:]:
        if path.name != keep and time.time() - changed > MIN_AGE:
            shutil.rmtree(path, ignore_errors=True)


def _announce(directory: Path) -> None:
    os.environ["NUMBA_CACHE_DIR"] = str(directory)
    numba = sys.modules.get("numba")
    if numba is not None:  # Numba was imported before us and has read the environment already
        numba.config.CACHE_DIR = str(directory)


# ---- The threading layer

PRIORITY = "omp tbb workqueue"
"""OpenMP first: sweeps gain nothing from threads under TBB, which Numba prefers if it finds it."""

_CHOICES = ("NUMBA_THREADING_LAYER", "NUMBA_THREADING_LAYER_PRIORITY")


def prefer_openmp() -> None:
    """Prefer OpenMP unless the user chooses a layer: results do not depend on it, speed does."""
    if any(os.environ.get(name) for name in _CHOICES):
        return
    os.environ["NUMBA_THREADING_LAYER_PRIORITY"] = PRIORITY
    numba = sys.modules.get("numba")
    if numba is not None:  # Numba was imported before us and has read the environment already
        numba.config.THREADING_LAYER_PRIORITY = PRIORITY.split()


def describe_layer() -> str:
    """The threading layer that kernels get, in words, found by starting its threads."""
    prefer_openmp()
    import numba

    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return "none: nothing is compiled, as NUMBA_DISABLE_JIT is set"
    try:
        require_layer()
    except NoThreadingLayer as error:
        return f"none: {error}"
    threads = numba.get_num_threads()  # starts them
    return f"{numba.threading_layer()}, {threads} threads"  # type: ignore[attr-defined]


class NoThreadingLayer(Exception):
    """The threading layer that the environment asks for is not there: one message for the user."""

    exit_code = 5


def require_layer() -> None:
    """Start the threads of a chosen layer; raises `NoThreadingLayer` before a kernel complains."""
    import numba

    chosen = [
        f"{name}={os.environ[name]}"
        for name in _CHOICES
        if os.environ.get(name) not in (None, "", PRIORITY)
    ]
    if not chosen:
        return
    try:
        numba.get_num_threads()  # starts them
    except ValueError as error:
        message = (
            f"{', '.join(chosen)}: Numba has no such threading layer here; unset it, or choose "
            "omp or workqueue"
        )
        raise NoThreadingLayer(message) from error
