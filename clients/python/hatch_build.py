"""Puts libhexad into the wheel: builds it with cargo, from the sources around this folder."""

import pathlib
import platform
import subprocess

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):
    def initialize(self, version, build_data):
        sources = pathlib.Path(self.root).parent.parent
        command = ["cargo", "build", "--release", "--quiet", "-p", "hexad-c", "--message-format=json-render-diagnostics"]
        built = subprocess.run(command, cwd=sources, check=True, stdout=subprocess.PIPE, text=True).stdout
        library = next(part for part in built.split('"') if part.endswith("/libhexad_c.so"))
        build_data["force_include"][library] = "hexad/libhexad.so.0"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-linux_{platform.machine()}"
