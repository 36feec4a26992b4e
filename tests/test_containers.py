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


def test_every_service_that_runs_clips_can_share_results_with_all_that_the_page_on_it_names():
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    built = {name: service for name, service in services.items() if "build" in service}
    named = set(re.findall(r"\bAWS_[A-Z_]+\b", (ROOT / "docs" / "sharing.md").read_text()))
    assert {"cpu", "gpu", "batch"} <= built.keys() and {"AWS_SESSION_TOKEN", "AWS_REGION"} <= named
    for name, service in built.items():
        default = re.search(r'^ARG EXTRAS="(.*)"$', (ROOT / service["build"]["dockerfile"]).read_text(), re.MULTILINE)
        extras = service["build"].get("args", {}).get("EXTRAS", default and default[1])
        assert extras and "s3" in extras.strip("[]").split(","), name
        assert {"GSAC_REMOTE", *named} <= set(service["environment"]), name
