"""The page of the app, built with gradio (extra `app`). Nothing else imports it."""

from __future__ import annotations

import asyncio
import os
import secrets
import sys
import time
from base64 import b64encode
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

from semgs.app.door import STREAM, inside
from semgs.app.jobs import IDENTIFIER, Job, Jobs
from semgs.app.limits import Limits
from semgs.app.requests import DEPTHS, OWN, RoomOptions
from semgs.app.uploads import GONE, PICTURES, UnusableUploadError, Upload
from semgs.files.errors import needs_extra
from semgs.viewer.failures import tell_failure

POLL_SECONDS = 0.4

MOST_PAGES = 8
"""So many pages show how far a job is; of more, those that were opened last."""

OTHER_CALLS = 40
"""So many calls of the page are answered at once, beside those that follow a job."""

MOST_SESSIONS = 400
"""Pages of which gradio keeps what was entered."""

IDLE_SECONDS = 5.0
"""So often it is looked whether a page still waits for something."""

MOST_FOLLOWED = 1000
"""Identifiers of uploads that are kept at most."""

TITLE = "SemGS: photos to a labelled room"

HEAD = """<header class="head"><p class="brand">SemGS</p><h1>Photos in, labelled room out</h1>
<p>Drop two to twelve photos of a room. Let them overlap, and take a step to the side between them. A clip or a zip of a scene works, too. {privacy}</p>
<details class="how"><summary>How to take them</summary>
<p>Stand two to three metres from what you want. Take six photos, and move 20 to 30 cm sideways between them. Avoid turning on the spot, mirrors, blank walls and blur, and do not zoom.</p>
<img src="data:image/svg+xml;base64,{drawing}" alt="A room from above. Yes: six photos side by side, a step apart. No: turning on the spot. No: photos with little in common.">
</details></header>"""

LOCAL = "Your photos stay on this computer."
REMOTE = (
    "Your photos are processed on this server and deleted {photos} after the room is ready, or was made again, except small copies of those that the room shows; "
    "the room is deleted after {kept}."
)

EMPTY = '<div class="quiet">Your room will appear here.</div>'

KEEP_ADDRESS = """(identifier) => {
    const address = new URL(window.location);
    identifier ? address.searchParams.set("room", identifier) : address.searchParams.delete("room");
    history.replaceState({}, "", address);
    return identifier;
}"""
"""Puts the room into the page's address, so that it is there again after a reload."""


def check_page_library() -> None:
    """Check that the app can be shown.

    Raises:
        ImportError: gradio is not installed.
    """
    os.environ["GRADIO_ANALYTICS_ENABLED"] = "False"
    with needs_extra("app", "the app needs gradio", "gradio"):
        import gradio  # noqa: F401


def mount_page(application: Any, jobs: Jobs, local: bool) -> tuple[Any, list[int]]:
    """Mount the page in an application of FastAPI.

    Args:
        application: the application.
        jobs: the queue.
        local: whether the page says that photos stay on this computer.

    Returns:
        the application with the page, and how many values each function of the page takes.
    """
    os.environ["GRADIO_TEMP_DIR"] = str(jobs.uploads)
    check_page_library()
    import gradio

    _restrain(gradio, jobs.limits)
    page = _build(jobs, local)
    page.state_session_capacity = MOST_SESSIONS
    web = files("semgs.app").joinpath("web")
    css, script = (web.joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    mounted = gradio.mount_gradio_app(
        application,
        page,
        path="/",
        css=css,
        theme=_theme(),
        footer_links=[],
        show_error=False,
        max_file_size=jobs.limits.file_bytes,
        head=f'<link rel="icon" href="data:,"><script>{script}</script>',
        ssr_mode=False,
        enable_monitoring=False,
    )
    # Only `launch` sets this, and without it gradio takes any file of this machine for an uploaded one.
    page.has_launched = True
    page.upload_file_set = Forgetful()

    mounted.add_middleware(Streams, queue=page._queue)
    return mounted, [len(function.inputs) for _, function in sorted(page.fns.items())]


def _restrain(gradio: Any, limits: Limits) -> None:
    """Let gradio print failures on one line, take no more files in a request than the page accepts, and no fields, which it would keep in memory; and keep equal files apart."""
    from gradio import queueing, route_utils, routes

    class Failures:
        """In place of the module `traceback`."""

        @staticmethod
        def print_exc() -> None:
            error = sys.exc_info()[1]
            if error is not None and not isinstance(error, gradio.Error):  # that is an answer to a user
                tell_failure(error)

    class FilesOnly(route_utils.GradioMultiPartParser):
        """Reads uploads."""

        def __init__(self, *given: Any, **options: Any) -> None:
            super().__init__(*given, **{**options, "max_fields": 0, "max_files": limits.photos + 1})

        async def parse(self) -> Any:
            kept: set[Any] = set()
            try:
                form: Any = await super().parse()
                kept = {value.file for _, value in form.multi_items()}
                return form
            except BaseException:  # also if the browser goes away, which gradio leaves out
                if self.upload_progress is not None and self.upload_id is not None:
                    self.upload_progress.stop_tracking(self.upload_id)
                raise
            finally:  # also of a form without an end
                for file in set(self._files_to_close_on_error) - kept:
                    file.close()
                    Path(file.name).unlink(missing_ok=True)

    class Apart(route_utils.GradioUploadFile):
        """An upload whose path is its own: gradio names it by its content, and the first room would delete what a second user dropped, too."""

        def __init__(self, *given: Any, **options: Any) -> None:
            super().__init__(*given, **options)
            self.sha.update(secrets.token_bytes(32))

    statuses: Any = routes.file_upload_statuses
    statuses._signals, statuses._statuses = Newest(asyncio.Event), Newest()

    def named(self: Any, file: Any) -> str:
        """The path of an uploaded file. gradio makes an empty temporary file for each, and leaves it."""
        return str(file.path)

    gradio.File._process_single_file = named
    for module in (queueing, route_utils, routes):
        setattr(module, "traceback", Failures)  # noqa: B010 - no part of what it promises
    route_utils.GradioMultiPartParser = FilesOnly  # type: ignore[misc]
    route_utils.GradioUploadFile = Apart  # type: ignore[misc]


class Streams:
    """Ends answers that gradio would keep open, and what it leaves behind of others.

    Args:
        app: gradio's application.
        queue: gradio's, of calls and of the messages that answer them.
    """

    def __init__(self, app: Any, queue: Any) -> None:
        self._app, self._queue = app, queue

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer one request."""
        if scope.get("path") != STREAM:
            return await self._app(scope, receive, send)
        session = parse_qs(scope["query_string"].decode("latin-1")).get("session_hash", [""])[0]
        try:
            await self._app(scope, while_needed(receive, lambda: self._waits(session)), send)
        finally:
            end_heartbeats(session)
            if session not in self._queue.pending_messages_per_session:  # it was broken off
                self._queue.pending_event_ids_session.pop(session, None)

    def _waits(self, session: str) -> bool:
        """Whether a page still waits for a message, or for a call that is alive: gradio forgets some calls without an answer."""
        messages = self._queue.pending_messages_per_session.get(session)
        calls = self._queue.pending_event_ids_session.get(session, ())
        alive = any(one in self._queue.event_ids_to_events for one in calls)
        return alive or (messages is not None and not messages.empty())


def while_needed(receive: Any, is_needed: Callable[[], bool]) -> Any:
    """What a browser sends after its request, until it goes away or its answer is no longer needed. gradio would keep such an answer open for ever.

    Args:
        receive: of ASGI.
        is_needed: whether something will still be answered.
    """

    async def received() -> Any:
        message = asyncio.ensure_future(receive())
        idle = 0  # once may be while the last message is on its way
        try:
            while idle < 2:
                done, _ = await asyncio.wait([message], timeout=IDLE_SECONDS)
                if done:
                    return message.result()
                idle = 0 if is_needed() else idle + 1
            return {"type": "http.disconnect"}
        finally:
            message.cancel()

    return received


def end_heartbeats(session: str) -> None:
    """End the tasks that send a sign of life to a page. gradio leaves them behind when a browser goes away.

    Args:
        session: gradio's name of the page.
    """
    for task in asyncio.all_tasks():
        frame = getattr(task.get_coro(), "cr_frame", None)
        if frame is not None and frame.f_code.co_name == "heartbeat" and frame.f_locals.get("session_hash") == session:
            task.cancel()


class Newest(defaultdict[str, Any]):
    """A dictionary of the `MOST_FOLLOWED` entries that were added last. gradio keeps one for every identifier of an upload that a browser asks for."""

    def __setitem__(self, key: str, value: Any) -> None:
        super().__setitem__(key, value)
        while len(self) > MOST_FOLLOWED:
            del self[next(iter(self))]


class Forgetful(set[Any]):
    """A set that gradio adds the path of each upload to, for a clean-up of its own that this page does not use."""

    def update(self, *_: Any) -> None:
        """Keep none."""


def _theme() -> Any:
    """Colours and fonts. Fonts are the system's: nothing is loaded from elsewhere."""
    import gradio

    fonts = ("system-ui", "-apple-system", "Segoe UI", "Roboto", "sans-serif")
    theme = gradio.themes.Base(neutral_hue="stone", font=fonts, font_mono=("ui-monospace", "monospace"))
    return theme.set(
        body_background_fill="#f7f6f3",
        body_background_fill_dark="#16181c",
        body_text_color="#23252b",
        body_text_color_dark="#e9e8e4",
        body_text_color_subdued="#646973",
        body_text_color_subdued_dark="#a3a8b1",
        background_fill_primary="#ffffff",
        background_fill_primary_dark="#1f2227",
        background_fill_secondary="#fbfaf8",
        background_fill_secondary_dark="#24282e",
        block_background_fill="#ffffff",
        block_background_fill_dark="#1f2227",
        block_border_color="#e0ddd6",
        block_border_color_dark="#343840",
        block_radius="12px",
        border_color_primary="#d5d1c8",
        border_color_primary_dark="#3d424b",
        color_accent="#2f6f5e",
        button_primary_background_fill="#2f6f5e",
        button_primary_background_fill_hover="#265b4d",
        button_primary_background_fill_dark="#7cc9b2",
        button_primary_background_fill_hover_dark="#93d6c2",
        button_primary_text_color="#ffffff",
        button_primary_text_color_dark="#10231d",
        button_secondary_background_fill="#ffffff",
        button_secondary_background_fill_dark="#24282e",
        button_secondary_border_color="#d5d1c8",
        button_secondary_border_color_dark="#3d424b",
        input_background_fill="#f4f3f0",
        input_background_fill_dark="#2b3037",
    )


def _build(jobs: Jobs, local: bool) -> Any:
    """The page: what can be dropped, options, progress and the room."""
    import gradio as gr

    with gr.Blocks(title=TITLE, fill_width=True, analytics_enabled=False, delete_cache=(3600, 3600)) as page:
        gr.HTML(HEAD.format(privacy=privacy_statement(local, jobs.limits), drawing=_drawing()))
        identifier = gr.Textbox("", visible="hidden", elem_id="room-identifier")
        with gr.Column(elem_id="ask") as ask:
            dropped = gr.File(
                label="Photos, a clip, or a zip", file_count="multiple", type="filepath", height=190, elem_id="drop"
            )
            gr.HTML(f'<ol class="photos" data-most="{jobs.limits.photos}"></ol>')
            with gr.Row(elem_id="actions"):
                make = gr.Button("Make the room", variant="primary", elem_id="make")
                example = gr.Button("Try the included room", elem_id="example")
        status = gr.HTML("", elem_id="status")
        with gr.Accordion("Options", open=False, elem_id="options") as folded:
            photos = gr.HTML("", visible=False)
            options = _options(gr, jobs)
            again = gr.Button("Make it again", variant="primary", visible=False)
        with gr.Row(elem_id="after"):
            cancel = gr.Button("Cancel", visible=False, elem_id="cancel")
            other = gr.Button("Make another room", visible=False)
        room = gr.HTML(EMPTY, elem_id="result")
        shown = [identifier, ask, status, folded, photos, again, cancel, other, room]

        def session(request: Any) -> str:
            return str(request.session_hash or "")

        def _upload(path: str) -> Upload:
            if not inside(Path(path), jobs.uploads):  # the door has checked this, too
                raise UnusableUploadError(GONE)
            return Upload(Path(path), Path(path).name)

        def view(job: Job | None, page: str, sentence: str = "") -> list[Any]:
            if job is not None and job.state in ("failed", "cancelled") and (room := jobs.find(job.earlier)):
                job, sentence = room, job.sentence or "Cancelled. This is the room as it was before."
            working = job is not None and not job.over
            done = job is not None and job.state == "done"
            repeatable = job is not None and may_repeat(job, page, local)
            again_from = job.uploads if job is not None and repeatable else ()  # others see no names of photos
            title = "Change options" if done else "Options"
            # Beside a room, what went wrong lies in the options; before there is one, they stay as they are.
            fold: dict[str, Any] = {"open": bool(sentence)} if done or not sentence else {}
            return [
                job.identifier if job is not None and (working or done) else "",
                gr.update(visible=not working and not done),
                status_text(job, jobs.limits, jobs.ahead(job) if job else 0, sentence),
                gr.update(visible=repeatable if done else not working, label=title, **fold),
                gr.update(visible=repeatable, value=numbered_photos(again_from)),
                gr.update(visible=repeatable),
                gr.update(visible=working),
                gr.update(visible=done),
                _frame(job) if job is not None and done else ("" if working else EMPTY),
            ]

        async def follow(job: Job, page: str) -> AsyncIterator[list[Any]]:
            job.pages += 1
            number, before = job.pages, ""
            while job.pages < number + MOST_PAGES:
                over = job.over
                now = f"{job.state} {jobs.ahead(job)} {job.stages}"  # time passes in the browser alone
                if now != before:
                    before = now
                    yield view(job, page)
                if over:
                    return
                await asyncio.sleep(POLL_SECONDS)

        async def submit_and_follow(
            page: str, paths: Sequence[str], values: Sequence[Any], example: bool, earlier: Job | None = None
        ) -> AsyncIterator[list[Any]]:
            try:
                uploads = earlier.uploads if earlier else [_upload(path) for path in paths]
                old = earlier.identifier if earlier else ""
                job = await asyncio.to_thread(jobs.submit, uploads, _chosen(values, example), example, page, old)
            except UnusableUploadError as error:
                yield view(earlier, page, str(error))
                return
            async for now in follow(job, page):
                yield now

        # These wait without a thread: the server has few, and answers everybody else with them.
        async def start(request: gr.Request, paths: Sequence[str] | None, *values: Any) -> AsyncIterator[list[Any]]:
            async for now in submit_and_follow(session(request), paths or (), values, example=False):
                yield now

        async def start_example(request: gr.Request, *values: Any) -> AsyncIterator[list[Any]]:
            async for now in submit_and_follow(session(request), (), values, example=True):
                yield now

        async def start_again(request: gr.Request, which: str, *values: Any) -> AsyncIterator[list[Any]]:
            job, page = jobs.find(which or ""), session(request)
            if job is None or not may_repeat(job, page, local):
                yield view(job, page, GONE)
                return
            async for now in submit_and_follow(page, (), values, job.request.kind == "example", job):
                yield now

        def stop(which: str) -> None:
            job = jobs.find(which or "")
            if job is not None:
                jobs.cancel(job)

        async def resume(request: gr.Request) -> AsyncIterator[list[Any]]:
            which = str(dict(request.query_params).get("room", ""))
            if not which:  # nothing changes: what a user has typed by now must stay
                yield [gr.skip() for _ in shown]
                return
            job = jobs.find(which) if IDENTIFIER.fullmatch(which) else None
            if job is None:
                kept = f"Rooms are kept for {jobs.limits.kept}; make it again from your photos."
                yield view(None, "", f"This room is no longer here. {kept}")
                return
            async for now in follow(job, session(request)):
                yield now

        for one in (start, start_example, start_again, resume):  # gradio reads them, and gr is no global name
            one.__annotations__["request"] = gr.Request
        hidden: Any = {"show_progress": "hidden", "api_visibility": "private"}
        many: Any = {**hidden, "concurrency_limit": None}
        make.click(start, [dropped, *options], shown, **many)
        example.click(start_example, options, shown, **many)
        cancel.click(stop, identifier, None, **many)
        again.click(start_again, [identifier, *options], shown, **many)
        other.click(lambda: [*view(None, ""), None], None, [*shown, dropped], **many)
        # In the browser alone: an answer of the server could come after that of the button.
        dropped.change(None, dropped, status, js="(files) => window.semgs.list(files)", **hidden)
        identifier.change(None, identifier, identifier, js=KEEP_ADDRESS, **hidden)
        page.load(resume, None, shown, **many)
    page.max_threads = MOST_PAGES * (jobs.limits.waiting + 1) + OTHER_CALLS
    page.queue(max_size=200, default_concurrency_limit=OTHER_CALLS)
    return page


def _options(gr: Any, jobs: Jobs) -> list[Any]:
    """The folded options, in the order of `_chosen`."""
    with gr.Row():
        views = gr.Radio(
            [("all", 0), ("2", 2), ("3", 3), ("4", 4)],
            value=0,
            label="Photos to use",
            info="All that add something, at most 12; or fewer, which is faster and shows less of the room.",
        )
        refine = gr.Checkbox(
            True, label="Refine", info="Fits the room to your photos: sharper images, for some seconds more."
        )
    with gr.Row():
        segmenter = gr.Dropdown(
            [(_source_name(one), one) for one in (OWN, *jobs.segmenters)],
            value=OWN,
            label="Classes from",
            info="More choices: start the app with --segmenter.",
        )
        words = gr.Textbox(
            "",
            label="Words",
            info="Classes to look for, with a segmenter that understands words.",
            placeholder="chair, mug, power socket",
        )
        depth = gr.Dropdown(
            [("network", "network"), ("depth camera", "sensor"), ("both", "both"), *((_source_name(one), one) for one in jobs.depths)],
            value=DEPTHS[0], label="Depth from", info="A depth camera needs depth maps in the zip.",
        )  # fmt: skip
    gr.HTML(
        '<p class="note">Scale: photos do not show how large a room is. If you know how far apart two of them were taken, sizes are in metres.</p>'
    )
    with gr.Row():
        first = gr.Number(0, label="First photo", info="its number above", precision=0, minimum=0)
        second = gr.Number(0, label="Second photo", info="its number above", precision=0, minimum=0)
        metres = gr.Number(0, label="Metres between them", info="0 if you do not know", minimum=0)
    return [views, refine, segmenter, words, depth, first, second, metres]


def _source_name(source: str) -> str:
    """The name of a segmenter or a source of depth: of a file, without its folder."""
    return source if source.startswith("hf:") else Path(source).name


def _chosen(values: Sequence[Any], example: bool = False) -> RoomOptions:
    """Options from the values of the page.

    Raises:
        UnusableUploadError: a value is not of its type.
    """
    views, refine, segmenter, words, depth, first, second, metres = values
    try:
        numbers = (0, 0, 0.0) if example else (int(first or 0), int(second or 0), float(metres or 0))
        return RoomOptions(int(views), bool(refine), str(segmenter), str(words or ""), str(depth), *numbers)
    except (TypeError, ValueError, OverflowError) as error:
        raise UnusableUploadError("An option has a value that cannot be used.") from error


def may_repeat(job: Job, page: str, local: bool) -> bool:
    """Whether a page may make a room again.

    Others may look at a room whose address they know, but another one made of its photos could show more of these.

    Args:
        job: the room.
        page: the page that wants it.
        local: whether all pages are of this computer.
    """
    return job.repeatable and (local or (bool(page) and job.page == page))


def _drawing() -> str:
    """The drawing of where to stand, for the address of an image."""
    return b64encode(files("semgs.app").joinpath("web/six_photos.svg").read_bytes()).decode()


def privacy_statement(local: bool, limits: Limits) -> str:
    """What becomes of photos.

    Args:
        local: whether they stay on this computer.
        limits: how long rooms and photos are kept.
    """
    return LOCAL if local else REMOTE.format(photos=limits.uploads_kept, kept=limits.kept)


def status_text(job: Job | None, limits: Limits, ahead: int = 0, sentence: str = "") -> str:
    """What a job is doing, or why it failed, as HTML.

    Args:
        job: the job; None if there is none.
        limits: how long rooms are kept.
        ahead: jobs before it.
        sentence: an error that no job has ended with.
    """
    if sentence or job is None:
        return _alert(sentence) if sentence else ""
    if job.state == "failed":
        return _alert(job.sentence)
    if job.state == "cancelled":
        return '<div class="status" role="status"><p>Cancelled. No room was made.</p></div>'
    if job.state == "done":
        said = f"Ready after {job.ended - job.started:.0f} s. The room is kept for {limits.kept} at this address."
        return f'<div class="status done" role="status"><p>{said}</p></div>'
    if job.state == "waiting":
        rooms = "1 room is" if ahead == 1 else f"{ahead} rooms are"
        what = "It starts in a moment." if not ahead else f"{rooms} before yours."
        return f'<div class="status" role="status"><p><b>Waiting.</b> {what}</p></div>'
    lines = []
    for stage in job.stages[-7:]:
        title = escape(stage.title)
        if stage.seconds is None:
            share = f'<progress max="{stage.of}" value="{stage.done}"></progress>' if stage.of else ""
            lines.append(f'<li class="now"><span>{title}</span>{share}{_clock(stage.start)}</li>')
        else:
            lines.append(f"<li><span>{title}</span><time>{stage.seconds:.1f} s</time></li>")
    if not lines:
        lines.append(f'<li class="now"><span>Getting ready</span>{_clock(job.started)}</li>')
    return (
        f'<div class="status" role="status" aria-live="polite"><p><b>Working on {escape(job.title)}</b> '
        f"{_clock(job.started)}</p><ol>{''.join(lines)}</ol></div>"
    )


def _alert(sentence: str) -> str:
    """An error as HTML."""
    return f'<div class="status error" role="alert"><p>{escape(sentence)}</p></div>'


def _clock(start: float) -> str:
    """The time since a start as HTML. The page's script lets it move on."""
    seconds = max(0.0, time.time() - start)
    return f'<time class="clock" data-seconds="{seconds:.1f}" aria-hidden="true">{seconds:.0f} s</time>'


def numbered_photos(uploads: Sequence[Upload]) -> str:
    """The names of photos as a numbered list in HTML. The page's script adds pictures."""
    names = [one.shown for one in uploads if one.ending in PICTURES]
    return f'<ol class="photos">{"".join(f"<li><span>{escape(name)}</span></li>" for name in names)}</ol>'


def _frame(job: Job) -> str:
    """The page of a room, in a frame that grows with it."""
    return f'<iframe class="room" src="rooms/{job.identifier}/index.html" title="Your room"></iframe>'
