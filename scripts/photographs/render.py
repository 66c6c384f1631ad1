"""Path-traced pictures of a surface with materials, by Blender's Cycles."""

import math
import pathlib
import tempfile

import bpy
import mathutils
import numpy as np
from PIL import Image, ImageFilter

from .cameras import HEIGHT, WIDTH

SAMPLES = 12
# Blur of the lens in pixels, noise of the sensor and darkening at the corners.
BLUR, NOISE, VIGNETTE = 0.4, 1.5, 0.15

# Base colours; bricks have a second one, one of the mortar, and their size in metres.
BRICKS = {
    "brick": ((0.30, 0.09, 0.06), (0.45, 0.16, 0.10), (0.42, 0.38, 0.34), 0.25, 0.075, 0.01),
    "pale brick": ((0.52, 0.42, 0.28), (0.62, 0.52, 0.36), (0.55, 0.52, 0.48), 0.25, 0.075, 0.01),
    "stone blocks": ((0.46, 0.44, 0.40), (0.56, 0.53, 0.47), (0.25, 0.24, 0.22), 0.9, 0.4, 0.015),
    "tiles": ((0.28, 0.10, 0.07), (0.38, 0.15, 0.10), (0.10, 0.05, 0.04), 0.3, 0.2, 0.02),
    "siding": ((0.55, 0.60, 0.58), (0.58, 0.63, 0.61), (0.25, 0.28, 0.27), 4.0, 0.15, 0.008),
    "paving": ((0.38, 0.37, 0.36), (0.48, 0.46, 0.44), (0.22, 0.21, 0.20), 0.4, 0.4, 0.012),
    "floor": ((0.38, 0.37, 0.36), (0.48, 0.46, 0.44), (0.22, 0.21, 0.20), 0.4, 0.4, 0.012),
    "planks": ((0.36, 0.19, 0.08), (0.45, 0.25, 0.11), (0.05, 0.03, 0.02), 2.0, 0.12, 0.004),
    "checks": ((0.65, 0.63, 0.58), (0.30, 0.33, 0.36), (0.15, 0.15, 0.15), 0.1, 0.1, 0.004),
}
PLAIN = {
    "plaster": (0.72, 0.68, 0.60),
    "ochre plaster": (0.62, 0.43, 0.20),
    "stone": (0.52, 0.50, 0.46),
    "slate": (0.16, 0.17, 0.19),
    "grass": (0.07, 0.16, 0.03),
    "asphalt": (0.10, 0.10, 0.11),
    "bark": (0.12, 0.08, 0.05),
    "leaf": (0.06, 0.16, 0.03),
    "paint": (0.05, 0.20, 0.16),
    "white paint": (0.80, 0.80, 0.78),
    "white wood": (0.75, 0.74, 0.70),
    "metal": (0.45, 0.46, 0.48),
    "dark metal": (0.06, 0.06, 0.07),
    "glass": (0.02, 0.03, 0.04),
    "red": (0.55, 0.04, 0.03),
    "green": (0.04, 0.35, 0.10),
    "blue": (0.03, 0.10, 0.45),
    "yellow": (0.65, 0.48, 0.04),
    "oak": (0.45, 0.27, 0.12),
    "lamp": (0.9, 0.85, 0.7),
}
# Of a square metre, as that of the sky.
LIGHT = {"lamp": 60.0}
ROUGHNESS = {"glass": 0.03, "metal": 0.35, "dark metal": 0.4, "paint": 0.4, "slate": 0.5}


def material(name, scale):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = ROUGHNESS.get(name, 0.8)
    places = nodes.new("ShaderNodeTexCoord").outputs["UV"]
    noise = nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 5.0 / scale
    noise.inputs["Detail"].default_value = 8.0
    links.new(places, noise.inputs["Vector"])
    mixed = nodes.new("ShaderNodeMixRGB")
    mixed.blend_type = "OVERLAY"
    mixed.inputs["Fac"].default_value = 0.0 if name == "glass" else 0.6
    links.new(noise.outputs["Fac"], mixed.inputs["Color2"])
    if name in BRICKS:
        one, two, mortar, width, height, gap = BRICKS[name]
        brick = nodes.new("ShaderNodeTexBrick")
        brick.inputs["Scale"].default_value = 1.0
        for label, color in (("Color1", one), ("Color2", two), ("Mortar", mortar)):
            brick.inputs[label].default_value = (*color, 1)
        brick.inputs["Brick Width"].default_value = width
        brick.inputs["Row Height"].default_value = height
        brick.inputs["Mortar Size"].default_value = gap / 2
        if name in ("checks", "floor", "paving", "planks"):
            brick.offset = 0.0
        links.new(places, brick.inputs["Vector"])
        links.new(brick.outputs["Color"], mixed.inputs["Color1"])
    else:
        mixed.inputs["Color1"].default_value = (*PLAIN[name], 1)
    links.new(mixed.outputs["Color"], shader.inputs["Base Color"])
    if name in LIGHT:
        shader.inputs["Emission Color"].default_value = (*PLAIN[name], 1)
        shader.inputs["Emission Strength"].default_value = LIGHT[name]
    return made


def flat_places(vertices, triangles):
    """Texture coordinates of each corner: along the horizontal and up the slope of its face."""
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    across = np.cross([0.0, 0.0, 1.0], normals)
    level = np.linalg.norm(across, axis=1) < 0.05
    across[level] = [1.0, 0.0, 0.0]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.where(level[:, None], [0.0, 1.0, 0.0], np.cross(normals, across))
    # Seen from the other side, a face shows the same courses.
    return np.stack([(corners * across[:, None]).sum(2), (corners * up[:, None]).sum(2)], 2)


def add_mesh(vertices, triangles, names, scale):
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
    slots = sorted(set(names))
    for name in slots:
        mesh.materials.append(bpy.data.materials.get(name) or material(name, scale))
    mesh.polygons.foreach_set("material_index", [slots.index(name) for name in names])
    layer = mesh.uv_layers.new()
    layer.data.foreach_set("uv", flat_places(vertices, triangles).ravel())
    bpy.context.collection.objects.link(bpy.data.objects.new("mesh", mesh))


def sky(random):
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    clouds, ramp = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeValToRGB")
    clouds.inputs["Scale"].default_value, clouds.inputs["Detail"].default_value = 3.0, 8.0
    ramp.color_ramp.elements[0].color = (0.35, 0.55, 0.9, 1)
    ramp.color_ramp.elements[0].position = 0.45
    ramp.color_ramp.elements[1].color = (0.9, 0.92, 0.95, 1)
    ramp.color_ramp.elements[1].position = 0.65
    links.new(clouds.outputs["Fac"], ramp.inputs["Fac"])
    links.new(ramp.outputs["Color"], nodes["Background"].inputs["Color"])
    nodes["Background"].inputs["Strength"].default_value = 0.7
    sun = bpy.data.lights.new("sun", "SUN")
    sun.energy, sun.angle = random.uniform(3.0, 5.0), math.radians(0.6)
    holder = bpy.data.objects.new("sun", sun)
    holder.rotation_euler = [
        math.radians(random.uniform(30, 55)),
        0,
        math.radians(random.uniform(-60, 60)),
    ]
    bpy.context.collection.objects.link(holder)


def prepare(surface, leaves, scale, focal, random):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_mesh(*surface, scale)
    for vertices, triangles in leaves:
        add_mesh(vertices, triangles, ["leaf"] * len(triangles), scale)
    sky(random)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = SAMPLES, True
    scene.cycles.max_bounces = 4
    scene.render.use_persistent_data = True
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.view_settings.view_transform = "Standard"
    lens = bpy.data.cameras.new("camera")
    lens.sensor_width, lens.lens = 36.0, 36.0 * focal / WIDTH
    lens.clip_start, lens.clip_end = 0.01 * scale, 500.0
    camera = bpy.data.objects.new("camera", lens)
    bpy.context.collection.objects.link(camera)
    scene.camera = camera


def picture(camera, random):
    scene = bpy.context.scene
    pose = np.eye(4)
    pose[:3, :3] = camera.rotation.T @ np.diag([1, -1, -1])
    pose[:3, 3] = camera.center
    scene.camera.matrix_world = mathutils.Matrix(pose.tolist())
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(pathlib.Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
        clean = Image.open(scene.render.filepath).convert("RGB")
    values = np.asarray(clean.filter(ImageFilter.GaussianBlur(BLUR)), float)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    away = ((x - WIDTH / 2) ** 2 + (y - HEIGHT / 2) ** 2) / (WIDTH**2 + HEIGHT**2) * 4
    values *= (1 - VIGNETTE * away)[..., None]
    values += random.normal(0, NOISE, values.shape)
    return Image.fromarray(np.clip(np.rint(values), 0, 255).astype(np.uint8))
