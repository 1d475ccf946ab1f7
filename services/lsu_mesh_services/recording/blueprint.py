"""What opens first: one tab for the overview, one per filter, then fusion, outputs, mesh and events.

Views are built in functions, because a view object that is used twice makes the viewer warn.
"""

from __future__ import annotations

from collections.abc import Sequence

import rerun.blueprint as rrb

from lsu_mesh_services.recording import frame
from lsu_mesh_services.recording.bands import outline
from lsu_mesh_services.recording.banks import SHOWN
from lsu_mesh_services.recording.entity_paths import EntityPaths, Output, path
from lsu_mesh_services.recording.timeline import SIM_TIME, STEP

OVERVIEW_STATES = 6
"""States that the overview shows; all of them have their own tab where there are more."""
FEW = 4
"""Filters whose sets can be told apart in one view."""
WINDOW = 100
"""Steps that plots of bands show."""
SETTLING = 20
"""So many steps are left out of plots over the whole run: the first sets are as wide as the prior and hide the rest."""
MARGIN = 0.14
"""Share of a plot over the whole run that stays free for its legend."""
LEGEND = 0.28
"""The same of a plot of a window of steps, which is narrower."""
Part = rrb.View | rrb.Container


def blueprint(names: EntityPaths) -> rrb.Blueprint:
    """The default blueprint of a mesh."""
    tabs = _of_single_targets(names) if names.configuration.instances is None else _of_banks(names)
    tabs += [_mesh(names), _events()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=STEP, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _of_single_targets(names: EntityPaths) -> list[Part]:
    configuration = names.configuration
    tabs: list[Part] = [_overview(names)]
    if len(names.states) > OVERVIEW_STATES:
        tabs.append(_grid("States", [_bands(names, i) for i in range(len(names.states))]))
    tabs += [_filter(names, name, settings.kind) for name, settings in configuration.filters.items()]
    tabs += [_fusion(names, name) for name in configuration.fusion]
    tabs += [_grid("Outputs", [_output(names, output) for output in names.outputs])]
    return [*tabs, _half_widths(names)] if names.learners else tabs


def _of_banks(names: EntityPaths) -> list[Part]:
    """Widths and statuses of all targets, and a tab for each of the few targets that are drawn."""
    configuration = names.configuration
    count = 0 if configuration.instances is None else configuration.instances.count
    peers = names.estimators
    widths = [_whole(names, f"{peer}: mean widths of {count} targets", [path("bank_widths", peer)]) for peer in peers]
    counts = [_whole(names, f"{peer}: targets, by status", [path("bank_counts", peer)]) for peer in peers]
    plots = [plot for pair in zip(widths, counts, strict=True) for plot in pair]
    tabs: list[Part] = [rrb.Grid(*plots, grid_columns=2, name="Banks")]
    seen = "the truth (pink) and its bounds" if names.truth_is_known else "its bounds"
    for target in range(min(SHOWN, count)):
        views = [
            _plot(names, f"{names.label(i)}: {seen}", [f"{path('targets', str(target), state)}/**"])
            for i, state in enumerate(names.states)
        ]
        tabs.append(_grid(f"Target {target}", views))
    return tabs


def _overview(names: EntityPaths) -> Part:
    shown = list(range(len(names.states)))
    if len(shown) > OVERVIEW_STATES:
        shown = list(dict.fromkeys([*names.axes(), *shown]))[:OVERVIEW_STATES]
    plots = [_bands(names, i) for i in shown]
    share = min(0.08 + 0.042 * len(names.estimators), 0.4)
    space = _space(names, frame.ALL, _sets_of_all(names))
    left = rrb.Vertical(space, _status(), row_shares=[1.0 - share, share])
    columns = 1 if len(plots) <= 3 else 2
    volume = _volume(names)
    rows = -(-len(plots) // columns)
    right = rrb.Vertical(rrb.Grid(*plots, grid_columns=columns), volume, row_shares=[rows, 1])
    return rrb.Horizontal(left, right, column_shares=[2, 3], name="Overview")


def _filter(names: EntityPaths, name: str, kind: str) -> Part:
    below = [_plot(names, "Widths", [path("widths", name)], legend=True)]
    if names.configuration.filters[name].transfer != "off":
        below.append(_plot(names, "Gain of the transfers [nat]", [path("gain", name)]))
    space = _space(names, name, [_set_of(name)])
    left = rrb.Vertical(space, *below, row_shares=[3.0] + [1.0] * len(below))
    return rrb.Horizontal(left, _states_of(names, name), column_shares=[2, 3], name=f"{name} ({kind})")


def _fusion(names: EntityPaths, name: str) -> Part:
    several = len(names.configuration.fusion) > 1
    few = len(names.configuration.filters) <= FEW
    space = _space(names, frame.ALL, _sets_of_all(names)) if few else _space(names, name, [_set_of(name)])
    share = min(0.08 + 0.042 * len(names.configuration.fusion[name].sources), 0.4)
    left = rrb.Vertical(
        space,
        _volume(names),
        rrb.StateTimelineView(name="Sources", origin="/", contents=[f"{path('trust', name)}/**"]),
        row_shares=[0.64 * (1.0 - share), 0.36 * (1.0 - share), share],
    )
    title = f"Fusion {name}" if several else "Fusion"
    return rrb.Horizontal(left, _states_of(names, name), column_shares=[2, 3], name=title)


def _states_of(names: EntityPaths, peer: str) -> Part:
    """Band and error of every state, side by side where there is room, else in tabs."""
    count = len(names.states)
    bands = [_bands(names, i, peer) for i in range(count)]
    if not names.truth_is_known:
        return _grid("Bands", bands)
    errors = [_errors(names, i, peer) for i in range(count)]
    if count <= 4:
        return rrb.Grid(*(view for pair in zip(bands, errors, strict=True) for view in pair), grid_columns=2)
    return rrb.Tabs(_grid("Bands", bands), _grid("Errors", errors), active_tab=0)


def _half_widths(names: EntityPaths) -> Part:
    """What is known of the noise: by how much bounds fail, and the half-widths in force at every filter."""
    configuration = names.configuration
    outputs = [output for output in names.outputs if any(output in names.outputs_of_watcher(w) for w in names.learners)]
    r = [
        _whole(names, f"r of {output.label}", [f"{path('half_widths', 'r', output.sensor, output.part)}/**"])
        for output in outputs
    ]
    rho = [_whole(names, f"rho of {part}", [f"{path('half_widths', 'rho', part)}/**"]) for part in names.disturbances]
    kinds = {one.learn for one in configuration.identifiers.values()}
    plots = r + rho if kinds != {"r"} or len(names.learners) > len(configuration.identifiers) else r
    if not configuration.identifiers:
        return _grid("Bounds", plots)
    title = "By what the bounds must be multiplied to explain the data; above 1 they fail"
    factor = _whole(names, title, ["/factor/**"])
    return rrb.Vertical(factor, _grid("Half-widths", plots), row_shares=[1, 3], name="Bounds")


def _mesh(names: EntityPaths) -> Part:
    health = rrb.StateTimelineView(name="Processes", origin="/", contents=["/health/**"])
    latency = _whole(names, "Age of the oldest measurement at arrival [ms]", ["/latency/**"])
    topology = rrb.GraphView(name="Who sends to whom", origin="/topology")
    left = rrb.Vertical(topology, latency, row_shares=[3, 2])
    right = rrb.Vertical(_status(), health, row_shares=[1, 2])
    return rrb.Horizontal(left, right, column_shares=[1, 1], name="Mesh")


def _events() -> Part:
    kinds = rrb.encodings.TextLogColumnKind
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(STEP, visible=False)],
        text_log_columns=[rrb.encodings.TextLogColumn(kind) for kind in (kinds.LogLevel, kinds.Body)],
    )
    return rrb.TextLogView(name="Events", origin="/events", columns=columns)


def _grid(name: str, views: Sequence[Part]) -> Part:
    columns = 1 if len(views) <= 3 else 2 if len(views) <= 8 else 3
    return rrb.Grid(*views, grid_columns=columns, name=name)


def _bands(names: EntityPaths, state: int, peer: str | None = None) -> Part:
    part = names.states[state]
    shown = f"{path('bands', part)}/**" if peer is None else path("bands", part, peer)
    whose = "the bounds of all peers" if peer is None else "its bounds"
    seen = f"the truth (pink) and {whose}" if names.truth_is_known else whose
    title = f"{names.label(state)}: {seen}"
    crowded = [] if peer else [path("bands", part, name) for name in _outlined(names)]
    contents = [shown, path("truth", part)]
    if peer in names.smoothers:
        contents.append(path("smoothed", part, peer))
        title += f", dark those given {names.configuration.filters[peer].lag} more steps"
    return _plot(names, title, contents, outlined=crowded)


def _outlined(names: EntityPaths) -> list[str]:
    """Peers whose bands are outlines where all are shown: the filters, unless they are few and there is no fusion."""
    filters = list(names.configuration.filters)
    return filters if names.configuration.fusion or len(filters) > 3 else []


def _errors(names: EntityPaths, state: int, peer: str) -> Part:
    part = names.states[state]
    return _plot(names, f"{names.label(state)} − truth", [path("errors", part, peer)])


def _output(names: EntityPaths, output: Output) -> Part:
    contents = [output.measured(), f"{path('outputs', output.sensor, output.part)}/**"]
    peers = [name for name, one in names.configuration.filters.items() if output.sensor in one.sensors]
    outlined = [output.predicted(peer) for peer in peers] if len(peers) > 3 else []
    return _plot(
        names,
        f"{output.label}: measured (grey), and predicted by the filters",
        contents,
        outlined=outlined,
    )


def _status() -> Part:
    return rrb.StateTimelineView(name="Status of the sets", origin="/", contents=["/status/**"])


def _plot(
    names: EntityPaths,
    name: str,
    contents: list[str],
    *,
    legend: bool = False,
    outlined: Sequence[str] = (),
) -> Part:
    """Series in a window of steps that ends at the cursor. All share their time axis, but for those with a legend."""
    seconds = WINDOW * names.configuration.mesh.dt
    now = rrb.TimeRangeBoundary.cursor_relative()
    begin = rrb.TimeRangeBoundary.cursor_relative(seq=-WINDOW)
    end = rrb.TimeRangeBoundary.cursor_relative(seq=round(LEGEND * WINDOW))
    linked = rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal)
    window = [
        rrb.VisibleTimeRange(STEP, start=begin, end=now),
        rrb.VisibleTimeRange(SIM_TIME, start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds), end=now),
    ]
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=contents,
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(begin, end)) if legend else linked,
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend),
        time_ranges=window,
        overrides={entity: outline() for entity in outlined} or None,
    )


def _volume(names: EntityPaths) -> Part:
    return _whole(names, "Log-volume of the sets", ["/log_volume/**"])


def _whole(names: EntityPaths, name: str, contents: list[str]) -> Part:
    """Series over the whole run but for its beginning, with room for the legend at the right."""
    mesh = names.configuration.mesh
    first = SETTLING if mesh.steps is None else min(SETTLING, mesh.steps // 10)
    room = WINDOW if mesh.steps is None else max(1, round(MARGIN * mesh.steps))
    now = rrb.TimeRangeBoundary.cursor_relative()
    from_step, from_time = (
        rrb.TimeRangeBoundary.absolute(seq=first),
        rrb.TimeRangeBoundary.absolute(seconds=first * mesh.dt),
    )
    until = rrb.TimeRangeBoundary.cursor_relative(seq=room)
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=contents,
        axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(from_step, until)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
        time_ranges=[
            rrb.VisibleTimeRange(STEP, start=from_step, end=now),
            rrb.VisibleTimeRange(SIM_TIME, start=from_time, end=now),
        ],
    )


def _set_of(name: str) -> str:
    return f"{path('space', 'sets', name)}/**"


def _sets_of_all(names: EntityPaths) -> list[str]:
    """Bodies of all peers; of many filters only the edges, so that the fused set stays visible among them."""
    configuration = names.configuration
    if len(configuration.filters) <= FEW:
        return ["/space/sets/**"]
    edges = [path("space", "sets", name, "edges") for name in configuration.filters]
    return [*(_set_of(name) for name in configuration.fusion), *edges]


def _space(names: EntityPaths, name: str, sets: list[str]) -> Part:
    axes = [names.states[axis] for axis in names.axes()]
    origin = frame.entity(name)
    title = f"Sets of {', '.join(axes)}" + (" with the truth (pink)" if names.truth_is_known else "")
    if len(axes) < 3:  # from the top
        height = 0.0 if len(axes) == 2 else 0.5 * frame.LANE * (len(names.estimators) + 1)
        position, target = (0.0, height, max(2.8, 2.5 * height)), (0.0, height, 0.0)
        eye = rrb.EyeControls3D(position=position, look_target=target, eye_up=(0.0, 1.0, 0.0))
    else:
        eye = rrb.EyeControls3D(position=(1.4, -2.45, 1.25), look_target=(0.0, 0.0, -0.1), eye_up=(0.0, 0.0, 1.0))
    contents = [*sets, "/space/truth/**", f"{origin}/**"]
    return rrb.Spatial3DView(
        name=title, origin=origin, contents=contents, eye_controls=eye, line_grid=rrb.LineGrid3D(visible=False)
    )
