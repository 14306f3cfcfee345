//! Every shader compiles for every layout of a slot, Vulkan takes it, and what Rust and the shaders share lies alike.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod support;

use std::collections::BTreeSet;

use ash::vk;
use fathomless::desktop::{Composer, PanePush};
use fathomless::gpu::{ComputePipeline, Depth, GraphicsInfo, GraphicsPipeline, Program, Shader, Source};
use fathomless::render::layout::{
    AidEye, AidPoint, AidSight, AidSolid, EyePush, HungUniform, Inspection, LinePoint, MaskCorner,
    MaterialUniform, PanelPush, QuadPush, Request, SceneUniform, SlotLayout, SurfaceUniform, TileRecord,
    VeilUniform, ViewUniform,
};
use fathomless::rust_layout;
use fathomless::shaders::{self, BUILT_IN, PROGRAMS};
use fathomless::terrain::tile::Cells;

/// The entry points of each program.
const ENTRIES: [&[&str]; 11] = [
    &["make_tiles"],
    &[
        "terrain_vertex",
        "terrain_vertex_of_eye",
        "terrain_fragment",
        "sky_vertex",
        "sky_vertex_of_eye",
        "sky_fragment",
        "face_vertex",
        "face_fragment",
    ],
    &["terrain_vertex", "terrain_vertex_of_eye", "terrain_fragment", "bake_vertex", "bake_fragment"],
    &["mask_vertex", "mask_vertex_of_eye", "mask_fragment"],
    &[
        "terrain_vertex",
        "terrain_vertex_of_eye",
        "terrain_fragment",
        "sky_vertex",
        "sky_vertex_of_eye",
        "sky_fragment",
        "face_vertex",
        "face_fragment",
        "inspect_fragment",
        "tinted_fragment",
        "faces_fragment",
    ],
    &["line_vertex", "line_vertex_of_eye", "line_fragment", "hidden_line_fragment"],
    &["pane_vertex", "pane_fragment", "overlay_vertex", "overlay_fragment"],
    &["panel_vertex", "panel_fragment"],
    &["quad_vertex", "quad_vertex_of_eye", "quad_vertex_alone", "quad_fragment"],
    &["veil_vertex", "veil_vertex_of_eye", "veil_fragment", "veil_fragment_encoded"],
    &[
        "solid_vertex",
        "solid_vertex_of_eye",
        "solid_fragment",
        "aid_line_vertex",
        "aid_line_vertex_of_eye",
        "aid_line_core",
        "aid_line_veil",
        "aid_line_hidden",
    ],
];

/// The pieces that are compiled together, and their entry points.
fn programs() -> [(&'static [Source<'static>], &'static [&'static str]); 11] {
    std::array::from_fn(|i| (PROGRAMS[i], ENTRIES[i]))
}

/// Every size of tile, with every mesh that fits it.
fn layouts() -> impl Iterator<Item = SlotLayout> {
    [16, 32, 64, 128].into_iter().flat_map(|cells| {
        let meshes = (1..).map(|n| 1 << n).take_while(move |&mesh| mesh <= cells);
        meshes.map(move |mesh| SlotLayout { cells: Cells::new(cells).unwrap(), mesh })
    })
}

fn compile(pieces: &[Source<'_>], layout: SlotLayout) -> Shader {
    Shader::compile(pieces, &shaders::constants(layout)).unwrap_or_else(|error| panic!("{layout:?}: {error}"))
}

#[test]
fn every_entry_point_becomes_spirv_for_every_layout() {
    for layout in layouts() {
        for (pieces, entries) in programs() {
            let shader = compile(pieces, layout);
            assert_eq!(shader.entry_points().collect::<Vec<_>>(), entries, "{layout:?}");
            for entry in entries {
                let words = shader.spirv(entry).unwrap_or_else(|error| panic!("{layout:?}: {error}"));
                assert_eq!(words[0], 0x0723_0203, "{entry} of {layout:?} is SPIR-V");
            }
        }
    }
}

#[test]
fn every_file_is_a_part_of_a_program_and_listed() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let files: BTreeSet<_> = files.map(|name| format!("shaders/{}", name.into_string().unwrap())).collect();
    assert_eq!(BUILT_IN.map(|(one, _)| one.name.to_owned()).into_iter().collect::<BTreeSet<_>>(), files);
    let used = PROGRAMS.into_iter().flatten().map(|one| one.name.to_owned());
    assert_eq!(used.collect::<BTreeSet<_>>(), files);
}

#[test]
fn the_parts_of_a_slot_follow_each_other() {
    for layout in layouts() {
        let (fine, coarse) = (layout.cells.fine_side(), layout.cells.coarse_side());
        assert_eq!(layout.coarse() - SlotLayout::FINE, fine * fine, "{layout:?}");
        assert_eq!(layout.fine_gradient() - layout.coarse(), coarse * coarse, "{layout:?}");
        assert_eq!(layout.coarse_gradient() - layout.fine_gradient(), (fine - 2).pow(2), "{layout:?}");
        assert_eq!(layout.words() - layout.coarse_gradient(), (coarse - 2).pow(2), "{layout:?}");
    }
}

#[test]
fn structs_lie_in_memory_as_their_rust_mirrors_do() {
    let layout = layouts().next().unwrap();
    let [tile, terrain, bake, mask, inspect, lines, mirror, panels, quad, veil, aids] =
        PROGRAMS.map(|pieces| compile(pieces, layout));
    let mirrors = [
        (&tile, "Request", rust_layout!(Request { residuals, level, x, z, c, gx, gz, slot, unused })),
        (
            &tile,
            "Surface",
            rust_layout!(SurfaceUniform {
                seed_low,
                seed_high,
                scheme,
                amplitude,
                period,
                tread_fall,
                riser_fall,
                only
            }),
        ),
        (&terrain, "Tile", rust_layout!(TileRecord { origin, size, slope, slot, corners, x, z, c, level })),
        (&mask, "MaskCorner", rust_layout!(MaskCorner { tangents, eye, unused })),
        (
            &inspect,
            "Inspection",
            rust_layout!(Inspection { palette, head_from_scene, surface, levels, face, unused }),
        ),
        (&lines, "LinePoint", rust_layout!(LinePoint { at, colour })),
        (&aids, "AidEye", rust_layout!(AidEye { clip_from_play, at, pixel })),
        (&aids, "AidSight", rust_layout!(AidSight { eyes, sun, unused, up, unused_too })),
        (&aids, "AidSolid", rust_layout!(AidSolid { a, radius_a, b, radius_b, colour, ring, glow, unused })),
        (&aids, "AidPoint", rust_layout!(AidPoint { at, half_width, tangent, colour })),
        (&mirror, "Pane", rust_layout!(PanePush { picture_from_pane, eye, unused, drawn })),
        (&panels, "PanelPush", rust_layout!(PanelPush { clip_per_point })),
        (&quad, "Hung", rust_layout!(HungUniform { clip_from_picture })),
        (&quad, "QuadPush", rust_layout!(QuadPush { view, linear })),
        (&veil, "Veil", rust_layout!(VeilUniform { lenses, ahead, inner, outer, strength, fade })),
        (&veil, "Eye", rust_layout!(EyePush { view, first_tile })),
        (&mask, "Eye", rust_layout!(EyePush { view, first_tile })),
        (&terrain, "Eye", rust_layout!(EyePush { view, first_tile })),
        (&terrain, "View", rust_layout!(ViewUniform { clip_from_scene, ray_from_clip })),
        (&terrain, "Material", rust_layout!(MaterialUniform { colour, slope, strata, grain, unused })),
        (
            &terrain,
            "Scene",
            rust_layout!(SceneUniform {
                views,
                sun_direction,
                encode,
                sun_colour,
                per_haze_begin,
                sky_zenith,
                sky_strength,
                sky_horizon,
                haze_middle,
                haze_steepness,
                haze_close,
                morph_start,
                per_morph_length,
                drift_phase,
                drift_per_octave,
                drift_tints,
                materials_used,
                strata_used,
                strata_per_cell,
                flat_shading,
                per_drift_begin,
                log_distance,
                backdrop,
                rim_skirt,
                unused,
                materials,
                tints,
                strata
            }),
        ),
    ];
    for (shader, name, rust) in mirrors {
        let wgsl = shader.layout(name).unwrap_or_else(|| panic!("no struct {name} in the shader"));
        // Names, offsets, sizes and the whole; a member that one side lacks shows too.
        assert_eq!(wgsl, rust, "{name}: the shader's on the left, Rust's on the right");
    }
    for shader in [&terrain, &bake, &inspect, &lines, &aids] {
        assert_eq!(shader.push_bytes() as usize, size_of::<EyePush>());
        assert_eq!(shader.layout("Scene"), terrain.layout("Scene"));
    }
}

#[test]
fn the_device_takes_every_pipeline_without_a_message() {
    let gpu = support::gpu();
    let colour = [vk::Format::R8G8B8A8_SRGB];
    for (cells, mesh) in [(16, 16), (32, 16), (64, 16), (64, 32), (128, 32), (128, 128)] {
        let layout = SlotLayout { cells: Cells::new(cells).unwrap(), mesh };
        let program = |name, pieces: &[_]| Program::new(&gpu, name, pieces, &layout.constants()).unwrap();
        let [(tile, _), (terrain, _), (bake, _), (mask, _), ..] = programs();
        drop(ComputePipeline::new(&program("tile", tile), "make_tiles").unwrap());
        let bake = program("bake", bake);
        let baked = [vk::Format::R8G8B8A8_SRGB, vk::Format::R32_SFLOAT];
        let compare = vk::CompareOp::GREATER;
        drop(GraphicsPipeline::new(&GraphicsInfo {
            depth: Some(Depth { format: vk::Format::D32_SFLOAT, compare, write: true }),
            ..GraphicsInfo::new(&bake, "bake_vertex", "bake_fragment", &baked)
        }));
        let (terrain, mask) = (program("terrain", terrain), program("mask", mask));
        let multiview = gpu.info.multiview_offered;
        for of_eye in [true, false].into_iter().filter(|of_eye| *of_eye || multiview) {
            for (what, program, compare, write) in [
                ("terrain", &terrain, vk::CompareOp::GREATER, true),
                ("sky", &terrain, vk::CompareOp::GREATER_OR_EQUAL, true),
                ("mask", &mask, vk::CompareOp::ALWAYS, true),
            ] {
                let vertex = format!("{what}_vertex{}", if of_eye { "_of_eye" } else { "" });
                let fragment = format!("{what}_fragment");
                let info = GraphicsInfo {
                    view_mask: if of_eye { 0 } else { 0b11 },
                    depth: Some(Depth { format: vk::Format::D32_SFLOAT, compare, write }),
                    ..GraphicsInfo::new(program, &vertex, &fragment, &colour)
                };
                drop(GraphicsPipeline::new(&info).unwrap());
            }
        }
    }
    drop(Composer::new(&gpu).unwrap());
    support::assert_clean(gpu);
}
