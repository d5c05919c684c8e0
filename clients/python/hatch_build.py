"""Puts libhexad into the wheel: HEXAD_LIBRARY, or builds it with cargo, from the sources around this folder."""

import os
import pathlib
import platform
import subprocess

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):
    def initialize(self, version, build_data):
        build_data["force_include"][os.environ.get("HEXAD_LIBRARY") or self.built()] = "hexad/libhexad.so.0"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-linux_{platform.machine()}"

    def built(self):
        sources = pathlib.Path(self.root).parent.parent
        command = ["cargo", "build", "--release", "--quiet", "-p", "hexad-c", "--message-format=json-render-diagnostics"]
        output = subprocess.run(command, cwd=sources, check=True, stdout=subprocess.PIPE, text=True).stdout
        return next(part for part in output.split('"') if part.endswith("/libhexad_c.so"))
