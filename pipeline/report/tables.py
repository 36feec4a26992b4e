"""Rows of the page's tables: stages, parameters, and provenance (models, versions, licences)."""

from __future__ import annotations

import importlib.metadata
import platform
from pathlib import Path
from typing import Any

from gsac.pipeline.outcomes import Outcome
from gsac.pipeline.params import config_values, meanings
from gsac.pipeline.report.results import Results, number

MB = 1e6
BLANK = {"seconds": None, "cpu": None, "memory": None, "bytes": None, "cached": False, "bar": 0.0, "error": ""}


def stage_rows(results: Results) -> list[dict[str, Any]]:
    """One row a stage, also of those that this run did not reach; `bar` is the share of the longest stage's time."""
    longest = max((number(row.get("seconds")) or 0 for row in results.rows.values()), default=0) or 1
    rows = []
    for name in results.order:
        row = results.rows.get(name)
        if row is None:
            rows.append(BLANK | {"name": name, "status": "not run" if results.has_run else "unknown",
                                 "bytes": results.size(name)})
            continue
        done = results.result(name) is row
        rows.append(BLANK | {
            "name": name, "status": str(row.get("status")),
            "seconds": number(row.get("seconds")) if done else None,
            "cpu": number(row.get("cpu_seconds")) if done else None,
            "memory": (number(row.get("peak_rss_mb")) or 0) * MB if done else None, "bytes": results.size(name),
            "cached": row.get("status") == Outcome.CACHED.value, "bar": 100 * (number(row.get("seconds")) or 0) / longest,
            "error": str(row.get("error") or ""),
        })
    return rows


def totals(results: Results) -> dict[str, float]:
    """Seconds of all stages however old, of those that ran in this run, and of those that came from the cache."""
    def total(field: str, *statuses: Outcome) -> float:
        words = {status.value for status in statuses}
        return sum(number(row.get(field)) or 0 for row in results.rows.values() if row.get("status") in words)

    ran, cached = total("seconds", Outcome.RAN), total("seconds", Outcome.CACHED)
    return {"seconds": ran + cached, "ran": ran, "cached": cached,
            "cpu": total("cpu_seconds", Outcome.RAN, Outcome.CACHED),
            "bytes": sum(results.size(name) or 0 for name in results.order)}


def parameters(results: Results) -> list[dict[str, Any]]:
    """Of each stage of the run: name, value, meaning, and the default where the value is another."""
    found = []
    for name, row in results.rows.items():
        values = row.get("params")
        if not isinstance(values, dict) or not values:
            continue
        defaults, meaning = defaults_and_meanings(results, name)
        rows = [{"name": key, "value": format_value(value), "meaning": meaning.get(key, ""),
                 "default": format_value(defaults[key]) if key in defaults and defaults[key] != value else None}
                for key, value in values.items()]
        found.append({"stage": name, "rows": rows, "changed": sum(row["default"] is not None for row in rows)})
    return found


def defaults_and_meanings(results: Results, stage: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Defaults and meanings of a stage's parameters; empty where the stage is not at hand."""
    try:
        config = results.project.stage(stage).config
        return config_values(config()), meanings(config)
    except Exception:  # a stage of another version: the values alone are shown
        return {}, {}


def format_value(value: Any) -> str:
    """A parameter's value as the page shows it."""
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value) or "(empty)"


def provenance(results: Results) -> dict[str, list]:
    """Network files, body model and versions at hand now; results from the cache were made with the same ones."""
    return {"models": networks(results), "body": body_model(results), "versions": versions(results)}


def networks(results: Results) -> list[dict[str, str]]:
    """Name, digest and licence of each model file that the run's stages need."""
    from gsac.avatar.network_files import licence_of
    from gsac.stages.contract import make_config

    found: dict[str, dict[str, str]] = {}
    for name, row in results.rows.items():
        try:
            stage = results.project.stage(name)
            needed = stage.models(make_config(stage, row.get("params") or {}))
        except Exception:  # a stage of another version: its needs are unknown here
            continue
        found |= {model: {"name": model, "sha256": published_digest(model), "licence": licence_of(model)} for model in needed}
    return list(found.values())


def published_digest(model: str) -> str:
    """Digest of a network's file as it was published, with the wheel that holds it where that is one of its own."""
    from gsac.avatar.network_files import MODELS, OPTIONAL

    if model in OPTIONAL:
        return f"{OPTIONAL[model].sha256} in {OPTIONAL[model].wheel}"
    return MODELS[model].sha256 if model in MODELS else "brought by the user"


def body_model(results: Results) -> list[dict[str, str]]:
    """Name, digest and licence of the body model; empty where no body was fitted."""
    for port in ("train/body.npz", "smplx/body.npz"):
        try:
            digest = body_digest(results.path(port))
        except Exception:  # absent or unreadable: the body's section says so
            continue
        own = own_body_digest()
        return [{"name": "open body" if digest == own else "body model", "sha256": digest or "not recorded",
                 "licence": "CC0-1.0" if digest == own else "of another body than the one at hand"}]
    return []


def body_digest(path: Path) -> str:
    """Digest of the body model that a body.npz was made with."""
    from gsac.avatar.artifacts import read_arrays

    return str(read_arrays(path)["model"])


def own_body_digest() -> str:
    """Digest of the open body."""
    import hashlib

    from gsac.avatar.body import OPEN_BODY

    return hashlib.sha256(OPEN_BODY.read_bytes()).hexdigest()


def versions(results: Results) -> list[str]:
    """`name version` of gsac, Python, and every distribution that a stage of the run declares."""
    names = {"gsac"}
    for name in results.rows:
        try:
            names |= set(results.project.stage(name).packages)
        except Exception:  # a stage of another version
            continue
    found = [f"Python {platform.python_version()}"]
    for name in sorted(names):
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{name} (not installed)")
    return found
