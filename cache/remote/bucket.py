"""A bucket or shared folder: objects by name, put where there is none, read up to a limit, listed and deleted.

Uses obstore (the extra `s3`), which takes credentials from the AWS_* variables. Its errors quote requests and answers, in which
credentials may stand: none of their text is kept.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from gsac.cache.errors import CacheError, CacheSetupError
from gsac.cache.root import REMOTE

INSTALL = "pip install 'gsac[s3]'"
SCHEMES = ("s3", "file")
CONNECT_S = 5.0
SMALL_S = 6.0
"""For the whole answer to a question about a record or a lease; for a part of a pack LARGE_S."""
LARGE_S = 60.0
SMALL = 1 << 20
RETRIES = 2
REST_S = 300.0
"""A remote that failed is not asked again for so long."""
STAGED = re.compile(r".*#\d+")
"""Names of files that a folder's writers have not finished."""


class RemoteError(CacheError):
    """The shared store did not do what it was asked; it may later. silent: it gave no answer at all."""

    def __init__(self, message: str, silent: bool = False) -> None:
        super().__init__(message)
        self.silent = silent


@dataclass(frozen=True)
class Entry:
    """One object of a list."""

    name: str
    bytes: int
    modified: datetime
    """By the server's clock."""


@dataclass(frozen=True)
class Content:
    """One object as it was read; tag: changes with each writing."""

    data: bytes
    tag: str | None


class Bucket:
    """One bucket and prefix, or one folder. Every method raises RemoteError where the other side fails."""

    def __init__(self, url: str) -> None:
        """url: `s3://bucket/prefix` or `file:///folder`. CacheSetupError where it is neither, or obstore is missing."""
        parts = urlsplit(url)
        if parts.username or parts.password or parts.query or parts.fragment:
            raise CacheSetupError(f"{REMOTE} holds more than a place: credentials belong into AWS_ACCESS_KEY_ID and "
                                   "AWS_SECRET_ACCESS_KEY; expected s3://bucket/prefix or file:///folder")
        if parts.scheme not in SCHEMES or not (parts.netloc if parts.scheme == "s3" else parts.path.startswith("/")):
            raise CacheSetupError(f"{REMOTE}={url}: expected s3://bucket/prefix or file:///folder")
        self.url = url
        self.folder = Path(unquote(parts.path)) if parts.scheme == "file" else None
        self.rests_until = 0.0
        """By the monotonic clock."""
        self.silent = False
        """Whether it gave no answer when it failed last."""
        self.said_failing = False
        self._small, self._large = (self._open(seconds) for seconds in (SMALL_S, LARGE_S))

    def _open(self, seconds: float) -> Any:
        try:
            from obstore.store import from_url
        except ImportError as error:
            raise CacheSetupError(f"{REMOTE} is set, and the package obstore that reads it is not installed: `{INSTALL}`, or unset "
                                   f"{REMOTE}") from error
        if self.folder is not None:
            if not self.folder.is_dir():
                raise CacheSetupError(f"{REMOTE}={self.url}: there is no such folder; make it, or mount it")
            return from_url(self.url)
        plain = any(os.environ.get(name, "").startswith("http://") for name in ("AWS_ENDPOINT_URL", "AWS_ENDPOINT"))
        try:
            return from_url(
                self.url,
                client_options={"timeout": timedelta(seconds=seconds), "connect_timeout": timedelta(seconds=CONNECT_S),
                                "allow_http": plain},
                retry_config={"max_retries": RETRIES, "retry_timeout": timedelta(seconds=seconds)},
            )
        except Exception as error:
            raise CacheSetupError(f"{REMOTE}={self.url} cannot be opened with these AWS_* variables "
                                   f"({type(error).__name__})") from None

    def read(self, name: str, limit: int, large: bool = False) -> Content | None:
        """An object of at most `limit` bytes; None where there is none. large: it may take LARGE_S to come."""
        import obstore

        with self._failing(f"read {name}"):
            try:
                answer = obstore.get(self._large if large else self._small, name)
            except FileNotFoundError:
                return None
            size = answer.meta["size"]
            if size > limit:
                raise RemoteError(f"{name} in {self.url} has {size:,} bytes; expected at most {limit:,}")
            data = bytes(answer.bytes())
            return Content(data, answer.meta["e_tag"]) if len(data) == size else None

    def has(self, name: str) -> bool:
        """Whether there is an object of this name."""
        import obstore

        with self._failing(f"look for {name}"):
            try:
                obstore.head(self._small, name)
            except FileNotFoundError:
                return False
            return True

    def put_new(self, name: str, data: bytes) -> bool:
        """Puts an object where none of its name is; returns whether none was."""
        import obstore
        from obstore.exceptions import AlreadyExistsError

        with self._failing(f"write {name}"):
            try:
                obstore.put(self._store(len(data)), name, data, mode="create")
            except AlreadyExistsError:
                return False
            return True

    def put(self, name: str, data: bytes) -> None:
        """Puts an object, over one that is there."""
        import obstore

        with self._failing(f"write {name}"):
            obstore.put(self._store(len(data)), name, data, mode="overwrite", use_multipart=False)

    def replace(self, name: str, data: bytes, tag: str | None) -> bool:
        """Puts an object over the one with this tag; returns whether that was still there.

        A folder cannot tell: there another may come in between.
        """
        import obstore
        from obstore.exceptions import NotFoundError, PreconditionError

        with self._failing(f"write {name}"):
            try:
                if self.folder is None:
                    obstore.put(self._small, name, data, mode={"e_tag": tag})
                    return True
                if obstore.head(self._small, name)["e_tag"] != tag:
                    return False
                obstore.put(self._small, name, data, mode="overwrite", use_multipart=False)
            except (PreconditionError, NotFoundError, FileNotFoundError):
                return False
            return True

    def list(self, folder: str) -> Iterator[Entry]:
        """All objects below a folder."""
        import obstore

        with self._failing(f"list {folder}"):
            for page in obstore.list(self._large, folder):
                for meta in page:
                    yield Entry(meta["path"], meta["size"], meta["last_modified"])

    def delete(self, names: list[str]) -> None:
        """Removes objects; those that are not there are passed over."""
        import obstore

        with self._failing(f"remove {len(names)} objects"):
            if self.folder is None:
                obstore.delete(self._large, names)
                return
            for name in names:
                with contextlib.suppress(FileNotFoundError):
                    obstore.delete(self._small, name)

    def now(self) -> datetime:
        """The time by the server's clock: that of an object which is put and removed for it."""
        import obstore

        name = f"clock/{os.urandom(8).hex()}"
        self.put(name, b"")
        try:
            with self._failing("ask for the time"):
                return obstore.head(self._small, name)["last_modified"]
        finally:
            self.delete([name])

    def unfinished(self) -> list[Path]:
        """Files of a shared folder that a writer has not finished. A bucket has none: every object is put in one request."""
        return [] if self.folder is None else [file for file in self.folder.rglob("*#*") if STAGED.fullmatch(file.name)]

    @property
    def rests(self) -> bool:
        """Whether it failed a short while ago."""
        return time.monotonic() < self.rests_until

    def fails(self, error: RemoteError) -> None:
        """Notes that it has just failed."""
        self.rests_until, self.silent = time.monotonic() + REST_S, error.silent

    def _store(self, size: int) -> Any:
        return self._small if size <= SMALL else self._large

    @contextlib.contextmanager
    def _failing(self, what: str) -> Iterator[None]:
        """RemoteError in our own words for whatever goes wrong."""
        from obstore.exceptions import BaseError, PermissionDeniedError, UnauthenticatedError

        try:
            yield
        except (PermissionDeniedError, UnauthenticatedError, PermissionError):
            raise RemoteError(f"{self.url} does not allow these credentials to {what}") from None
        except (BaseError, OSError, ValueError, NotImplementedError) as error:
            reason = _reason(str(error))
            raise RemoteError(f"{self.url} failed to {what} ({reason})", reason == SILENT) from None


SILENT = "no connection, or no answer in time"
REASONS: tuple[tuple[str, Callable[[re.Match], str]], ...] = (
    (r"non-2xx status code: (\d{3})", lambda found: f"HTTP status {found[1]}"),
    (r"No such file|not found", lambda found: "it is not there"),
    (r"timed out|deadline", lambda found: SILENT),
    (r"request or response body|decoding|unexpected end", lambda found: "the answer was cut"),
    (r"169\.254\.|metadata", lambda found: "no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"),
    (r"HTTP error|sending request|connect", lambda found: SILENT),
)
"""What the text of an error shows, and our words for it."""


def _reason(text: str) -> str:
    for pattern, words in REASONS:
        found = re.search(pattern, text)
        if found is not None:
            return words(found)
    return "no reason known"
