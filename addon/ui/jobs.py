"""Long work as an operator: at once from a script, step by step with progress and Esc in a window."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

TICK_S = 0.02  # between two steps of a job, in which Blender answers


def part(steps: Iterator, first: float, last: float) -> Iterator[tuple[float, str]]:
    """Steps of a part of a job, whose own shares run from 0 to 1, as shares of the whole; returns what they return."""
    try:
        while True:
            share, sentence = next(steps)
            yield first + (last - first) * share, sentence
    except StopIteration as end:
        return end.value
    finally:
        steps.close()


def layer_named(scene, name: str):
    """A view layer that was chosen before a step; ValueError where it is gone. Held itself, it would point to nothing
    once the artist removes it, and the context's is of another scene once the window shows one."""
    layer = scene.view_layers.get(name)
    if layer is None:
        raise ValueError(f"Scene '{scene.name}' has no view layer '{name}' any more.")
    return layer


def depsgraph_of(context, scene, layer):
    """The evaluated scene, whatever the window shows meanwhile."""
    with context.temp_override(scene=scene, view_layer=layer):
        return context.evaluated_depsgraph_get()


class Job:
    """Base of operators whose work is the generator `work(context)`.

    It yields (share done, sentence) and may end early with a ValueError or RuntimeError, which becomes a report. What
    it holds must be given back in a `finally`: on Esc it is closed, and before an undo, which may free the data-blocks
    that the work refers to. One job runs at a time.
    """

    running: Job | None = None
    progress: tuple[float, str] = (0.0, "")  # of the one that runs: share done, and what is being done

    @classmethod
    def poll(cls, context):
        return Job.running is None

    def work(self, context) -> Iterator[tuple[float, str]]:
        raise NotImplementedError

    def execute(self, context):
        try:
            for _ in self.work(context):
                pass
        except (ValueError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        Job.running, Job.progress = self, (0.0, "")
        self._work, self._undone = self.work(context), False
        self._timer = context.window_manager.event_timer_add(TICK_S, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            try:
                self._work.close()
            finally:
                self._end(context)
            self.report({"INFO"}, f"{self.bl_label} was cancelled.")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._undone:
            self._end(context)
            self.report({"WARNING"}, f"{self.bl_label} was cancelled, because its scene was undone or redone.")
            return {"CANCELLED"}
        try:
            share, sentence = next(self._work)
            context.window_manager.progress_update(100 * share)
            context.workspace.status_text_set(f"{self.bl_label}: {sentence} — Esc to cancel")
            if (share, sentence) != Job.progress:
                Job.progress = share, sentence
                _redraw(context)
        except StopIteration:
            self._end(context)
            return {"FINISHED"}
        except (ValueError, RuntimeError) as error:
            self._end(context)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        except ReferenceError:
            self._end(context)
            self.report({"ERROR"}, f"{self.bl_label} was cancelled, because what it works on was deleted.")
            return {"CANCELLED"}
        except BaseException:
            self._end(context)
            raise
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Blender ends the operator: the window is closed or another file is opened."""
        try:
            self._work.close()
        finally:
            Job.running = None

    def before_undo(self) -> None:
        """Give up what the work refers to, while it is there; the operator ends with its next event."""
        self._undone = True
        self._work.close()

    def _end(self, context) -> None:
        Job.running = None
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        _redraw(context)


def draw_progress(layout) -> None:
    """How far the running job is, in a panel; nothing while none runs."""
    if Job.running is not None:
        share, sentence = Job.progress
        layout.progress(factor=share, text=sentence or "begins")
        layout.label(text="Esc cancels")


def _redraw(context) -> None:
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("NODE_EDITOR", "IMAGE_EDITOR", "PROPERTIES"):
                area.tag_redraw()


@bpy.app.handlers.persistent
def _before_undo(*_) -> None:
    if Job.running is not None:
        Job.running.before_undo()


def register() -> None:
    bpy.app.handlers.undo_pre.append(_before_undo)
    bpy.app.handlers.redo_pre.append(_before_undo)


def unregister() -> None:
    bpy.app.handlers.redo_pre.remove(_before_undo)
    bpy.app.handlers.undo_pre.remove(_before_undo)
