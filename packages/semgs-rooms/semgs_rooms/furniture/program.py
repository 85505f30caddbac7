"""Generates furniture with Infinigen and Blender, in their environment: a separate program that does not import semgs.

    python program.py JOBS.json OUT

A job is `{"name": ..., "makes": [...]}`. For each, OUT gets NAME.npz, or NAME.txt with the reason for failure; both appear only once
they are complete. A make is one object of one of Infinigen's factories:

    factory     its path below infinigen.assets.objects
    seed        of the factory
    setting     one of SETTINGS, with `size` its argument [m]; "" leaves the factory as it is
    triangles   approximate number to keep
    flatten     objects whose flat faces are merged: "all", "first" or "none"
    weld        whether to merge corners within 0.2 mm
    picture     side of the image of base colours [px], 0 for none
    simplify    triangles to keep per material, by quadric simplification of the joined surface; 0 keeps all

NAME.npz contains for make k the arrays k/vertices [n 3] [m], k/faces [t 3], k/uv [t 3 2] ((0, 0) at the image's lower left),
k/object [t] and k/material [t] (indices), k/materials (names) and k/picture [h w 3] (sRGB, top row first).
"""

# ruff: noqa: NPY002  Infinigen draws from the one generator that is numpy's own

import importlib
import json
import logging
import os
import random
import sys
import traceback
from pathlib import Path
from typing import Any

CLEAR = (0.6, 0.65, 0.68, 1.0)
"""Colour for transparent materials."""
EMITTERS = (
    "BSDF_DIFFUSE", "BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC", "BSDF_GLASS", "BSDF_TRANSLUCENT",
    "BSDF_REFRACTION", "BSDF_VELVET", "BSDF_SHEEN", "BSDF_TOON", "BSDF_TRANSPARENT",
)  # fmt: skip
"""Shaders whose colour is shown as it is."""
ROOM = 0.015
"""Distance between the cloths of a bed, for when they are coarser [m]."""
FEWEST = 40
"""Minimum number of triangles of each object of a piece."""


def main(jobs, out):
    """Do all jobs of a file that have no result yet."""
    start_infinigen()
    for job in json.loads(Path(jobs).read_text(encoding="utf-8")):
        target = Path(out, f"{job['name']}.npz")
        if target.exists():
            continue
        try:
            write(target, [make(**one) for one in job["makes"]])
        except Exception as error:
            traceback.print_exc()
            reason = target.with_suffix(".txt.part")
            reason.write_text(" ".join(f"{type(error).__name__}: {error}".split())[:300], encoding="utf-8")
            reason.replace(target.with_suffix(".txt"))


def start_infinigen():
    """Import Infinigen without its search for add-ons on the network, which furniture does not need."""
    logging.disable(logging.WARNING)
    import infinigen.core.init as infinigen

    infinigen.require_blender_addon = lambda *_, **__: True
    folders = ["infinigen_examples/configs_indoor", "infinigen_examples/configs_nature"]
    infinigen.apply_gin_configs(folders, configs=[], overrides=[], skip_unknown=True)


def make(factory, seed, setting="", size=(), triangles=7000, flatten="none", weld=True, picture=512, simplify=0):
    """One object of a factory as arrays."""
    import bpy
    import numpy as np
    from infinigen.core.util.math import FixedSeed

    clear()
    module, name = factory.rsplit(".", 1)
    np.random.seed(seed)
    random.seed(seed)
    with FixedSeed(seed):
        known = importlib.import_module(f"infinigen.assets.objects.{module}")
        maker = (coarse_bed() if setting == "bed" else getattr(known, name))(seed)
        if setting:
            tell: Any = SETTINGS[setting]
            tell(maker, *size)
        root = maker.spawn_asset(seed)
        try:
            maker.finalize_assets(root)
        except Exception:
            traceback.print_exc()  # only wear and tear fails here; the piece is complete without it
    bpy.context.view_layer.update()
    joined = join([root, *root.children_recursive], triangles, flatten, weld)
    arrays = {"picture": bake(joined, picture)} if picture else {"picture": np.zeros((0, 0, 3), np.uint8)}
    arrays |= read_arrays(joined, bool(picture))
    return simplified(arrays, simplify) if simplify else arrays


# Settings: configure factories beyond their seed.


def set_bed(maker, width):
    """A bed of a width [m]."""
    maker.width = width


def set_sofa(maker, depth, width, height):
    """A sofa of a size, with its footrest in."""
    from infinigen.assets.objects.seating.sofa import sofa_parameter_distribution

    maker.params = sofa_parameter_distribution(dimensions=(depth, width, height))
    maker.params |= {"Footrest": False, "Scaling footrest": 0.6}


def set_drawers(maker, depth, width, height):
    """A chest of drawers of a size."""
    maker.dimensions, maker.drawer_only = (depth, width, height), True
    maker.params = maker.sample_params()


def set_electric(maker):
    """A stove without gas, whose grates are most of its triangles."""
    maker.params["UseGas"] = 0


def set_kitchen(maker, depth, width, height):
    """A run of kitchen cabinets of a size."""
    maker.dimensions.x, maker.dimensions.y, maker.dimensions.z = depth, width, height


def set_island(maker, depth, width):
    """A kitchen island of a size."""
    maker.dimensions.x, maker.dimensions.y = depth, width


def set_window(maker, width, height):
    """A window without curtains."""
    before_window(maker, width, height, None)


def set_curtain(maker, width, height, left, right, folds):
    """A window with a pair of drapes. They end at shares `left` and `right` of the width from the middle; `folds` is the distance
    between folds [m]."""
    drapes = {"CurtainMidL": -left * width, "CurtainMidR": right * width, "CurtainIntervalNumber": int(width / folds)}
    before_window(maker, width, height, drapes)


def before_window(maker, width, height, drapes):
    """Set the parameters of a factory's windows, and name their materials so that they can be identified later."""
    sample = maker.sample_asset_params

    def parameters(*_, **__):
        found = sample((width, height, 0.1), None, drapes is not None, False)
        names = {"Curtain": "cloth", "CurtainFrame": "rod", "Frame": "frame", "": "pane"}
        for key, name in names.items():
            found[f"{key}Material"].name = name
        return found | (drapes or {})

    maker.sample_asset_params = parameters


SETTINGS = {
    "bed": set_bed, "sofa": set_sofa, "drawers": set_drawers, "electric": set_electric, "kitchen": set_kitchen,
    "island": set_island, "window": set_window, "curtain": set_curtain,
}  # fmt: skip


def coarse_bed() -> Any:
    """A factory of beds with a fast cloth simulation: coarse grids, few frames, and pillows placed instead of dropped."""
    import numpy as np
    from infinigen.assets.objects.clothes import blanket
    from infinigen.assets.objects.seating import bed, bedframe, pillow
    from infinigen.assets.scatters.clothes import cloth_sim
    from infinigen.assets.utils.decorate import read_co, subsurf
    from infinigen.core.util import blender as butil
    from infinigen.core.util.blender import deep_clone_obj
    from mathutils import Matrix, Vector
    from numpy.random import uniform

    blanket_grid, pillow_grid = blanket.new_grid, pillow.new_grid

    def coarse_grid(x_subdivisions, y_subdivisions):
        rows = max(4, int(34 * y_subdivisions / x_subdivisions))
        return blanket_grid(x_subdivisions=34, y_subdivisions=rows)

    blanket.new_grid = coarse_grid
    pillow.new_grid = lambda x_subdivisions, y_subdivisions: pillow_grid(x_subdivisions=20, y_subdivisions=20)

    def top(thing):
        return np.max(read_co(thing)[:, 2]) + thing.location[2]

    def lay(cloth, x, height):
        """Place a cloth above the bed, across it."""
        cloth.location = x, 0, height + 0.03
        cloth.rotation_euler[-1] = np.pi / 2
        butil.apply_transform(cloth, True)

    class Bed(bed.BedFactory):
        """As Infinigen's, with the head at x = 0."""

        def create_asset(self, i, **params):
            """Frame, mattress, sheet, sometimes a cover, pillows."""
            frame = bedframe.BedFrameFactory.create_asset(self, i=i, **params)
            mattress = self.make_mattress(i)
            if len(mattress.data.vertices) > 15000:
                mattress.modifiers.new("d", "DECIMATE").ratio = 15000 / len(mattress.data.vertices)
                butil.apply_modifiers(mattress)
            cloths = [self.spread(i, mattress)]
            if uniform() < 0.5:
                cloths.append(self.cover(i, cloths[0], mattress))
                cloths[1].location.z += ROOM  # coarse cloths cross a little
            pillows = self.pillows(i, top(mattress))
            mattress.scale.z *= 1 - ROOM / top(mattress)
            for thing in (mattress, *cloths, *pillows):
                thing.parent = frame
            butil.select_none()
            return frame

        def spread(self, i, mattress):
            """The cloth on the mattress."""
            kind = "comforter" if self.sheet_type == "box_comforter" else self.sheet_type
            if kind == "quilt":
                maker, pressure = self.quilt_factory, 0.0
            elif kind == "comforter":
                maker, pressure = self.comforter_factory, uniform(0.6, 1.2)
            else:
                maker, pressure = self.box_comforter_factory, uniform(3, 6)
            head = uniform(0.3, 0.55)
            maker.size = self.size - head + uniform(-0.1, 0.12)
            maker.width = self.mattress_factory.width + uniform(0.35, 0.75)
            sheet = maker(i)
            maker.finalize_assets(sheet)
            lay(sheet, head + maker.size / 2, top(mattress))
            cloth_sim(
                sheet, [mattress], 34, mass=0.05, tension_stiffness=2, distance_min=8e-3, use_pressure=True,
                uniform_pressure_force=pressure, use_self_collision=False,
            )  # fmt: skip
            subsurf(sheet, 2)
            return sheet

        def cover(self, i, sheet, mattress):
            """A second cloth across the foot."""
            maker = self.cover_factory
            maker.width = maker.width * uniform(0.9, 1.0)
            maker.size = self.size * uniform(0.2, 0.35)
            cover = maker(i)
            maker.finalize_assets(cover)
            lay(cover, self.size - maker.size / 2 - uniform(0.02, 0.3), top(sheet))
            cloth_sim(cover, [sheet, mattress], 28, mass=0.05, tension_stiffness=2, distance_min=8e-3)
            subsurf(cover, 1)
            return cover

        def pillows(self, i, height):
            """A row of pillows at the head, sometimes with a row of cushions in front."""
            maker = self.pillow_factory
            maker.shape, maker.width = "rectangle", uniform(0.6, 0.72)
            maker.size = maker.width * uniform(0.58, 0.7)
            count = 1 if self.width < 1.15 else 2
            rows = [self.row(maker, i, count)]
            if uniform() < 0.45:
                maker = pillow.PillowFactory(self.factory_seed + 77, self.coarse)
                maker.shape, maker.width = "square", uniform(0.4, 0.5)
                maker.size = maker.width
                rows.append(self.row(maker, i, count))
            start = 0.05
            for number, row in enumerate(rows):
                tilt = uniform(0.6, 1.0) if number else uniform(0, 0.35)
                end = start
                for k, thing in enumerate(row):
                    corners = read_co(thing)
                    turn = Matrix.Rotation(tilt, 4, "Y") @ Matrix.Rotation(np.pi / 2 + uniform(-0.07, 0.07), 4, "Z")
                    thing.rotation_mode = "XYZ"
                    thing.matrix_world = turn
                    turned = np.array([turn @ Vector(corner) for corner in corners[::7]])
                    across = (k - 0.5) * min(self.width * 0.5, 0.55 if number else 0.8) if count > 1 else 0
                    x, y = start - turned[:, 0].min() + uniform(0, 0.03), across + uniform(-0.03, 0.03)
                    thing.location = (x, y, height - turned[:, 2].min() - 0.01)
                    end = thing.location[0] + turned[:, 0].max()
                start += 0.6 * (end - start)
            return [thing for row in rows for thing in row]

        def row(self, maker, i, count):
            """Equal pillows."""
            first = maker(i)
            maker.finalize_assets([first])
            return [first, *(deep_clone_obj(first) for _ in range(count - 1))]

    return Bed


# From Blender's objects to arrays.


def clear():
    """Remove what an earlier object left."""
    import bpy

    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing, do_unlink=True)
    kinds = ("meshes", "materials", "node_groups", "images", "curves", "textures")
    for blocks in (getattr(bpy.data, kind) for kind in kinds):
        for block in [block for block in blocks if block.users == 0]:
            blocks.remove(block)


def triangles_of(thing):
    """Number of triangles of an object's faces."""
    return sum(len(face.vertices) - 2 for face in thing.data.polygons)


def level(counts, target):
    """The cap on each of some counts so that their sum meets a target; counts below the cap stay."""
    left = target
    for k, count in enumerate(sorted(counts)):
        share = left // (len(counts) - k)
        if count > share:
            return share
        left -= count
    return max(counts)


def select(things):
    """Select only these objects, of which the first is active."""
    import bpy

    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
    bpy.context.view_layer.objects.active = things[0]


def apply(thing, kind, **settings):
    """Apply a modifier to an object."""
    import bpy

    bpy.context.view_layer.objects.active = thing
    modifier = thing.modifiers.new(kind, kind)
    for name, value in settings.items():
        setattr(modifier, name, value)
    bpy.ops.object.modifier_apply(modifier=modifier.name)


def join(things, target, flatten, weld):
    """Join all objects into one mesh of about `target` triangles in world coordinates; an attribute of each face names its object."""
    import bpy
    import numpy as np

    things = [thing for thing in things if thing.type in ("MESH", "CURVE")]
    for thing in things:
        thing.hide_set(False)
        thing.hide_viewport = False
    select(things)
    bpy.ops.object.make_single_user(object=True, obdata=True)
    bpy.ops.object.convert(target="MESH")
    places = [thing.matrix_world.copy() for thing in things]
    for thing, place in zip(things, places, strict=True):
        thing.parent = None
        thing.matrix_world = place
    bpy.ops.object.transform_apply(location=True, rotation=True, scale=True)
    things = [thing for thing in things if len(thing.data.polygons)]
    if sum(map(triangles_of, things)) > target:
        for number, thing in enumerate(things):
            if weld:
                apply(thing, "WELD", merge_threshold=2e-4)
            if flatten == "all" or (flatten == "first" and number == 0):
                apply(thing, "DECIMATE", decimate_type="DISSOLVE", angle_limit=0.12, delimit={"MATERIAL"})
    most = level([triangles_of(thing) for thing in things], target)
    for number, thing in enumerate(things):
        count, wanted = triangles_of(thing), max(FEWEST, most)
        if count > 1.02 * wanted:
            apply(thing, "TRIANGULATE")
            apply(thing, "DECIMATE", ratio=wanted / count)
        mark = thing.data.attributes.get("piece_") or thing.data.attributes.new("piece_", "INT", "FACE")
        mark.data.foreach_set("value", np.full(len(thing.data.polygons), number, np.int32))
        if not thing.material_slots:
            thing.data.materials.append(bpy.data.materials.new("plain"))
    select(things)
    if len(things) > 1:
        bpy.ops.object.join()
    apply(things[0], "TRIANGULATE")
    for slot in things[0].material_slots:
        slot.material = slot.material or bpy.data.materials.new("plain")
    return things[0]


def bake(thing, side):
    """Unwrap an object, bake its base colours and return the image."""
    import bpy
    import numpy as np

    select([thing])
    layers = thing.data.uv_layers
    shown = next((layer.name for layer in layers if layer.active_render), None)
    while len(layers) >= 8:
        layers.remove(layers[-1])
    layers.new(name="atlas_")
    layers.active = layers["atlas_"]
    if shown and shown in layers:  # the materials use this layer
        layers[shown].active_render = True
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=1.15, island_margin=0.004, area_weight=0.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    picture = bpy.data.images.new("atlas_", side, side, alpha=False)
    seen: set = set()
    for slot in thing.material_slots:
        slot.material.use_nodes = True
        tree = slot.material.node_tree
        emit_colour(tree, seen)
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = picture
        for other in tree.nodes:
            other.select = False
        node.select = True
        tree.nodes.active = node
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.use_denoising = 2, False
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    bpy.ops.object.bake(type="EMIT", margin=4, use_clear=True)
    pixels = np.empty(side * side * 4, np.float32)
    picture.pixels.foreach_get(pixels)
    return np.round(255 * pixels.reshape(side, side, 4)[::-1, :, :3].clip(0, 1)).astype(np.uint8)


def emit_colour(tree, seen):
    """Make a material emit its base colour, without lighting."""
    if tree is None or tree in seen:
        return
    seen.add(tree)
    for node in list(tree.nodes):
        if node.type == "GROUP":
            emit_colour(node.node_tree, seen)
        elif node.type == "BSDF_PRINCIPLED":
            copy_colour(tree, node.inputs["Base Color"], node.inputs["Emission Color"])
            fix(tree, node.inputs["Emission Strength"], 1.0)
            fix(tree, node.inputs["Alpha"], 1.0)
        elif node.type in EMITTERS:
            emitter = tree.nodes.new("ShaderNodeEmission")
            if node.type == "BSDF_TRANSPARENT":
                emitter.inputs["Color"].default_value = CLEAR
            else:
                copy_colour(tree, node.inputs["Color"], emitter.inputs["Color"])
            for link in list(node.outputs[0].links):
                tree.links.new(emitter.outputs[0], link.to_socket)
        elif node.type == "OUTPUT_MATERIAL":
            for name in ("Displacement", "Volume"):
                unlink(tree, node.inputs[name])


def unlink(tree, target):
    """Remove all links to an input."""
    for link in list(target.links):
        tree.links.remove(link)


def copy_colour(tree, source, target):
    """Copy an input, with its link or value, to another."""
    unlink(tree, target)
    if source.is_linked:
        tree.links.new(source.links[0].from_socket, target)
    else:
        target.default_value = source.default_value


def fix(tree, target, value):
    """Set an input to a constant."""
    unlink(tree, target)
    target.default_value = value


def read_arrays(thing, unwrapped):
    """The arrays of a triangulated object."""
    import numpy as np

    def values(items, name, width, dtype):
        array = np.empty(len(items) * width, dtype)
        items.foreach_get(name, array)
        return array

    mesh = thing.data
    uv = (
        values(mesh.uv_layers["atlas_"].data, "uv", 2, np.float32)
        if unwrapped
        else np.zeros(2 * len(mesh.loops), np.float32)
    )
    return {
        "vertices": values(mesh.vertices, "co", 3, np.float32).reshape(-1, 3),
        "faces": values(mesh.loops, "vertex_index", 1, np.int32).reshape(-1, 3),
        "uv": uv.reshape(-1, 3, 2),
        "object": values(mesh.attributes["piece_"].data, "value", 1, np.int32),
        "material": values(mesh.polygons, "material_index", 1, np.int32),
        "materials": np.array([slot.material.name for slot in thing.material_slots]),
    }


def simplified(arrays, target):
    """The arrays simplified to about `target` triangles per material; object indices and texture coordinates are lost."""
    import fast_simplification
    import numpy as np

    vertices, faces, materials, start = [], [], [], 0
    for number in range(len(arrays["materials"])):
        own = arrays["faces"][arrays["material"] == number]
        if not len(own):
            continue
        grid = np.round(arrays["vertices"] / 1e-5).astype(np.int64)
        _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
        points, own = arrays["vertices"][first], inverse.reshape(-1)[own]
        used, own = np.unique(own, return_inverse=True)
        points, own = points[used], own.reshape(-1, 3).astype(np.int32)
        if len(own) > target:
            points, own = fast_simplification.simplify(points.astype(np.float32), own, target_count=target)
        vertices.append(points)
        faces.append(own + start)
        materials.append(np.full(len(own), number, np.int32))
        start += len(points)
    count = sum(map(len, faces))
    return arrays | {
        "vertices": np.concatenate(vertices).astype(np.float32),
        "faces": np.concatenate(faces).astype(np.int32),
        "material": np.concatenate(materials),
        "object": np.zeros(count, np.int32),
        "uv": np.zeros((count, 3, 2), np.float32),
    }


def write(target, makes):
    """Write the arrays of all objects; the file appears only once it is complete."""
    import numpy as np

    part = target.with_name(f".{target.name}.part")
    with part.open("wb") as file:
        np.savez(file, **{f"{number}/{key}": array for number, one in enumerate(makes) for key, array in one.items()})
    part.replace(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(0)  # Blender exits slowly and sometimes crashes
