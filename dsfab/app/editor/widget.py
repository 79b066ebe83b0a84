"""`Editor`: the page of the editor as a notebook widget, which needs the extra `notebook`."""

import queue
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import anywidget
import traitlets

from dsfab.app.editor.page import HANDLERS, RequestFields, widget_module
from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import OpenedPreset
from dsfab.core.errors import DsfabError
from dsfab.design.design import Design
from dsfab.preset.model import Preset


class Editor(anywidget.AnyWidget):
    """The editor's page in a notebook.

    changes : changed values of the open preset, by dotted key. Assign a new dict; invalid values raise PresetError.
    view : camera, section plane, colours and layers of the page.    height : height of the widget, pixels."""

    changes = traitlets.Dict().tag(sync=True)
    view = traitlets.Dict().tag(sync=True)
    height = traitlets.Int(640).tag(sync=True)

    def __init__(self, opened: OpenedPreset, drafted: Design | None = None, **traits: Any) -> None:
        self._esm = widget_module()
        self._session = Session(opened, drafted)
        self._session.__enter__()
        self._news = self._session.jobs.add_listener()
        self._heard = False
        super().__init__(**traits)
        self.on_msg(self._handle_message)
        if drafted is None:
            self._session.ask_solve({})  # solve while the page loads
        threading.Thread(target=self._forward_news, args=(self._news,), name="dsfab-editor-news", daemon=True).start()

    @property
    def preset(self) -> Preset:
        """The preset on the page. Raises PresetError for invalid changes."""
        return self._session.current_preset.preset_with(self.changes)

    @property
    def files(self) -> list[Path]:
        """Paths of the files of the last build. dsfab deletes these files when the widget or Python closes."""
        return self._session.builds.latest

    def close(self) -> None:
        """Remove the widget and stop its jobs."""
        super().close()
        self._session.__exit__()

    def set_state(self, sync_data: Mapping[str, Any]) -> None:
        """Accept the values that the page sends, without a check."""
        self._heard = True
        try:
            super().set_state(sync_data)
        finally:
            self._heard = False

    @traitlets.validate("changes")
    def _validate_changes(self, proposal: Mapping[str, Any]) -> Mapping[str, Any]:
        changes: Mapping[str, Any] = proposal["value"]
        if not self._heard:
            self._session.current_preset.preset_with(changes)
        return changes

    def _handle_message(self, _: object, content: RequestFields, __: object) -> None:
        reply: dict[str, Any] = {"answer": content.get("ask")}
        try:
            answer = self._answer(str(content.get("name")), content.get("given", {}))
        except DsfabError as error:
            self.send({**reply, "error": str(error)})
            return
        if isinstance(answer, bytes):
            self.send(reply, buffers=[answer])
        else:
            self.send({**reply, "told": answer})

    def _answer(self, name: str, fields: RequestFields) -> RequestFields | bytes:
        if name == "start":
            return self._session.start()
        if name == "model":
            return self._session.model(int(fields.get("have", 0)))
        if name == "cut":
            return self._session.cut_sheet(int(fields.get("draft", 0)))
        if name == "file":
            path = self._session.builds.file(int(fields.get("build", 0)), int(fields.get("index", 0)))
            if path is None:
                raise DsfabError("this build has no file of this name; build again")
            return path.read_bytes()
        if name not in HANDLERS:
            raise DsfabError(f"the editor does not know the request {name!r}; reload the page")
        return HANDLERS[name](self._session, fields)

    def _forward_news(self, news: "queue.Queue[dict[str, Any] | None]") -> None:
        while (record := news.get()) is not None:
            self.send({"news": record})
