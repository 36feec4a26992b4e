"""The parser of all command lines of `gsac`."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from gsac.stages.contract import BadInput, did_you_mean


class CommandParser(argparse.ArgumentParser):
    """Of the program, by argparse's own way of each command, and of each benchmark: what is wrong is one sentence, and an option is
    its whole name, since the beginning of one may be that of two in the next version."""

    def __init__(self, *given: Any, **named: Any):
        super().__init__(*given, allow_abbrev=False, **named)

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{message}; `{self.prog} --help` tells what is taken")

    def parse_known_args(self, *given: Any) -> Any:
        found, unknown = super().parse_known_args(*given)
        option = next((word.partition("=")[0] for word in unknown if word.startswith("-")), None)
        if option is not None:
            known = [name[2:] for name in self._option_string_actions if name.startswith("--")]
            near = did_you_mean(option.lstrip("-"), known, "--")
            raise BadInput(f"unknown option {option}{near}; `{self.prog} --help` lists them")
        if unknown:
            raise BadInput(f"{unknown[0]} is one word too many; `{self.prog} --help` tells what is taken")
        return found, unknown
