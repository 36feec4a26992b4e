"""The containers: what they are made from."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PINNED = re.compile(r"[\w./-]+:[\w.-]+@sha256:[0-9a-f]{64}")
"""Name, tag, which is for people, and digest."""


def test_every_image_from_elsewhere_is_pinned_by_its_digest():
    bases = [line.split()[1] for file in (ROOT / "docker").glob("*.Dockerfile") for line in file.read_text().splitlines()
             if line.startswith("FROM ")]
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"].values()
    pulled = [service["image"] for service in services if "build" not in service]
    assert len(bases) == 2 and len(pulled) == 1
    assert [image for image in bases + pulled if not PINNED.fullmatch(image)] == []
