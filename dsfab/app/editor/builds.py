"""`Builds`: what the page had made, folder by folder; the files stay where `Outputs` puts them."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from dsfab.app.editor.building import BuildRequest
from dsfab.app.editor.job import JobProgress
from dsfab.app.editor.outputs import Outputs


class Builds:
    """Files that were built, by the number of their build; `aside` is where they are while they are made."""

    def __init__(self, outputs: Outputs, aside: Path) -> None:
        self.outputs, self._aside = outputs, aside
        self._files: dict[int, list[Path]] = {}

    def file(self, build: int, index: int) -> Path | None:
        """A file that was built, by its number; the page names no path."""
        files = self._files.get(build, [])
        return files[index] if 0 <= index < len(files) else None

    @property
    def latest(self) -> list[Path]:
        """The files that were built last."""
        return list(self._files[max(self._files)]) if self._files else []

    def taken(self, name: str) -> dict[str, Any]:
        """What the page asks the person before it writes into the folder of that name; nothing where it need not."""
        count = self.outputs.standing(name)
        if not count:
            return {}
        place = f"{self.outputs.shown}/{name}"
        files = "1 file" if count == 1 else f"{count} files"
        would = "files of the same names, and what a build wrote there, would be replaced."
        text = f"{place} holds {files} of before; {would}"
        return {"taken": text, "free": self.outputs.free(name)}

    def make(self, request: BuildRequest, progress: JobProgress) -> dict[str, Any]:
        """Build, move the files to their place, and tell the page of them. Raises DsfabError, and Cancelled."""
        from dsfab.app.editor.process import built_apart

        name = request.preset.name
        request = replace(request, before=self.outputs.folder(name))
        folder = Path(tempfile.mkdtemp(prefix="build-", dir=self._aside))
        made = built_apart(request, folder, progress)
        there = self.outputs.publish(folder, name)
        folder.rmdir()
        number = len(self._files) + 1
        self._files[number] = files = [there / path.name for path in made.files]
        listed = [{"name": path.name, "bytes": path.stat().st_size} for path in files]
        place = f"{self.outputs.shown}/{name}" if self.outputs.shown else ""
        facts = made.facts
        if "told" in facts:  # name the place where the file is now
            facts = facts | {"told": [line.replace(str(folder), place or str(there)) for line in facts["told"]]}
        return {"build": number, "files": listed, "folder": place, **facts}
