"""A disk that forgets: what a power cut may leave of a directory, from a record of all calls.

POSIX promises little. Bytes are on the disk once their file has been given to ``fsync``; names are
once their directory has. Until then each may be there or not: a file may have its new name and none
of its bytes, or a directory may still show what had been removed. `PowerCuts` records the calls of
a program, and builds the directories that a cut between two of them may leave: of every directory
the present names or those of its last ``fsync``, and of all files the present bytes or those of
their last ``fsync``.
"""

import itertools
import os
import shutil
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

Names = dict[str, "File | None"]
"""What a directory shows; ``None`` is a directory."""


Content = dict[str, bytes | str | None]
"""Files of a directory with their bytes; a string is where a link leads, ``None`` a directory."""


@dataclass(frozen=True)
class Left:
    """A directory that a power cut may leave; ``reason``: what of the last calls is on the disk."""

    reason: str
    content: Content

    def write(self, target: Path) -> None:
        """Make it at ``target``, in place of what is there."""
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir()
        for name, data in self.content.items():
            if data is None:
                (target / name).mkdir()
            elif isinstance(data, str):
                (target / name).symlink_to(data)
            else:
                (target / name).write_bytes(data)


Inspect = Callable[[str, Iterator[Left]], None]


@dataclass(eq=False)
class File:
    """A file: its bytes as the program sees them, and as they are on the disk for sure."""

    data: bytearray = field(default_factory=bytearray)
    synced: bytes = b""
    mode: int = 0o644
    target: str | None = None  # of a symbolic link


@dataclass(eq=False)
class Directory:
    """A directory: its names as the program sees them, and as they are on the disk for sure."""

    names: Names = field(default_factory=dict)
    synced: Names = field(default_factory=dict)


class PowerCuts:
    """Follows the calls of a program about one directory; give `hook` to ``system_calls.hooked``.

    After every call that changes the empty directory ``root``, ``inspect`` gets its name and what a
    power cut now could leave, as far as nothing like it came before in the same ``era``: what the
    program has promised so far. What was right before may be wrong after a promise.
    """

    def __init__(self, root: Path, inspect: Inspect, era: Callable[[], Hashable]) -> None:
        self.root = root.absolute()
        self.count = 0
        self._inspect, self._era = inspect, era
        self._directories: dict[Path, Directory] = {self.root: Directory()}
        self._open: dict[int, tuple[Path, File | None]] = {}
        self._seen: set[int] = set()

    def hook(self, name: str, args: tuple[Any, ...], call: Callable[[], Any]) -> Any:
        """Carry out a call and follow it."""
        where = self._where(name, args)
        result = call()
        if where is not None:
            getattr(self, f"_on_{name}")(where, args, result)
            if name not in ("open", "close") or self._has_changed(name, args):
                self.count += 1
                self._inspect(f"{name} (call {self.count})", self._states())
        return result

    def _where(self, name: str, args: tuple[Any, ...]) -> Path | None:
        """Path of the file or directory that a call is about; ``None`` if it is none of ours."""
        if isinstance(args[0], int):
            return self._open[args[0]][0] if args[0] in self._open else None
        path = Path(args[1] if name in ("link", "symlink") else args[0]).absolute()
        return path if path.is_relative_to(self.root) else None

    def _has_changed(self, name: str, args: tuple[Any, ...]) -> bool:
        return name == "open" and len(args) > 1 and bool(args[1] & os.O_CREAT)

    # What each call does.

    def _on_open(self, path: Path, args: tuple[Any, ...], descriptor: int) -> None:
        if path in self._directories:
            self._open[descriptor] = (path, None)
            return
        names = self._names_of(path)
        file = names.get(path.name)
        if file is None:
            file = names[path.name] = File()
        if len(args) > 1 and args[1] & os.O_TRUNC:
            file.data.clear()
        self._open[descriptor] = (path, file)

    def _on_close(self, _path: Path, args: tuple[Any, ...], _result: None) -> None:
        del self._open[args[0]]

    def _on_pwrite(self, _path: Path, args: tuple[Any, ...], written: int) -> None:
        descriptor, data, offset = args
        self._put(descriptor, bytes(data)[:written], offset)

    def _on_write(self, _path: Path, args: tuple[Any, ...], written: int) -> None:
        descriptor, data = args
        # All our descriptors of this kind append
        self._put(descriptor, bytes(data)[:written], len(self._file(descriptor).data))

    def _put(self, descriptor: int, data: bytes, offset: int) -> None:
        content = self._file(descriptor).data
        content.extend(bytes(max(offset - len(content), 0)))
        content[offset : offset + len(data)] = data

    def _on_ftruncate(self, _path: Path, args: tuple[Any, ...], _result: None) -> None:
        content = self._file(args[0]).data
        del content[args[1] :]
        content.extend(bytes(args[1] - len(content)))

    def _on_posix_fallocate(self, _path: Path, args: tuple[Any, ...], _result: None) -> None:
        content = self._file(args[0]).data
        content.extend(bytes(max(args[1] + args[2] - len(content), 0)))

    def _on_fsync(self, path: Path, args: tuple[Any, ...], _result: None) -> None:
        file = self._open[args[0]][1]
        if file is None:
            directory = self._directories[path]
            directory.synced = dict(directory.names)
        else:
            file.synced = bytes(file.data)

    def _on_fchmod(self, _path: Path, args: tuple[Any, ...], _result: None) -> None:
        self._file(args[0]).mode = args[1]

    def _on_replace(self, path: Path, args: tuple[Any, ...], _result: None) -> None:
        target = Path(args[1]).absolute()
        self._names_of(target)[target.name] = self._names_of(path).pop(path.name)

    _on_rename = _on_replace

    def _on_unlink(self, path: Path, _args: tuple[Any, ...], _result: None) -> None:
        del self._names_of(path)[path.name]

    def _on_mkdir(self, path: Path, _args: tuple[Any, ...], _result: None) -> None:
        self._directories[path] = Directory()
        self._names_of(path)[path.name] = None

    def _on_rmdir(self, path: Path, _args: tuple[Any, ...], _result: None) -> None:
        del self._names_of(path)[path.name]

    def _on_link(self, path: Path, args: tuple[Any, ...], _result: None) -> None:
        source = Path(args[0]).absolute()
        self._names_of(path)[path.name] = self._names_of(source)[source.name]

    def _on_symlink(self, path: Path, args: tuple[Any, ...], _result: None) -> None:
        self._names_of(path)[path.name] = File(target=os.fspath(args[0]))

    def _file(self, descriptor: int) -> File:
        file = self._open[descriptor][1]
        assert file is not None
        return file

    def _names_of(self, path: Path) -> Names:
        return self._directories[path.parent].names

    # What a power cut may leave.

    def _states(self) -> Iterator[Left]:
        pending = [p for p, d in self._directories.items() if d.names != d.synced]
        for is_data_there in (False, True):
            for choice in itertools.product((False, True), repeat=len(pending)):
                current = {
                    path for path, is_current in zip(pending, choice, strict=True) if is_current
                }
                content = dict(self._content(self.root, current, is_data_there=is_data_there))
                identity = hash(
                    (self._era(), *sorted((name, hash(data)) for name, data in content.items()))
                )
                if identity in self._seen:
                    continue
                self._seen.add(identity)
                shown = (
                    ", ".join(str(path.relative_to(self.root)) for path in sorted(current))
                    or "no directory"
                )
                yield Left(
                    f"new names in {shown}; {'all' if is_data_there else 'only synced'} bytes",
                    content,
                )

    def _content(
        self, path: Path, current: set[Path], *, is_data_there: bool
    ) -> Iterator[tuple[str, bytes | str | None]]:
        directory = self._directories[path]
        for name, file in (directory.names if path in current else directory.synced).items():
            inner = path / name
            relative = str(inner.relative_to(self.root))
            if file is not None:
                yield (
                    relative,
                    file.target
                    if file.target is not None
                    else bytes(file.data)
                    if is_data_there
                    else file.synced,
                )
            else:
                yield relative, None
                yield from self._content(inner, current, is_data_there=is_data_there)

    def as_seen(self) -> Content:
        """What the program sees, as the real directory must be: no call is overlooked."""
        return dict(self._content(self.root, set(self._directories), is_data_there=True))
