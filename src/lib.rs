//! Fathomless: a VR headset viewer for a fractal landscape you can fall into for ever, and come back out of.
//!
//! An OpenXR session draws both eyes of a quadtree of height tiles with reversed-Z depth; what is too far away to show
//! parallax is baked into a cubemap that both eyes share. Without a headset the same code runs on a mock runtime that
//! is built in: on a desk, in tests and in CI.
//!
//! # Code map
//!
//! ```text
//! main.rs       exit code <- app::run(cli::parse())
//! terrain/      PURE: the surface in exact integers, the path, the selection of tiles, the backdrop's layers
//! world/        PURE: a world file: what the surface is made of and what it looks like
//! flight/       PURE: flights, keyframed or computed: the pose of any frame by itself
//! course.rs     PURE: a flight's poses placed in a world
//! address.rs    PURE: a place as a line of text, exact to the bit
//! bindings.rs   PURE: which inputs of which controllers do what
//! controllers/  PURE: hands and what they hold, as what a person wants; helm.rs who steers: the flight or a person
//! comfort.rs    PURE: what spares the wearer's stomach: the view narrowed, jumps in the dark, rest without a wish
//! aids.rs       PURE: what is drawn over the land for a person in a headset: hands, rays, the way back, vignette
//! input.rs      PURE: what a person wants in a frame, whatever device it came from
//! inspect.rs    PURE: options for seeing how it works, with the words that explain them
//! pilot/        PURE: moving by hand: speed, scale and upright after the nearest ground; land in the hands, dives, the way back
//! settings/     PURE but for one file: what a person may set, from the manual, files, environment and options
//! rig.rs        PURE: the play space's place in the terrain
//! gpu/          VULKAN, thinly: device, memory, shaders, pipelines, frames in flight
//! render/       what a frame draws: tiles, terrain, backdrop, sky, panels; one file per thing drawn
//! xr/           EDGE: the OpenXR session
//! desktop/      EDGE: the window: keys and mouse, the panels' input, and the mirror: its picture, made of the eyes'
//!               pictures, and its camera
//! mock/         an OpenXR runtime without a headset
//! panels/       the panels over the mirror, laid out by egui: numbers in, wishes and triangles out; no GPU, no window
//! yardstick.rs  PURE: depths in things that people know
//! quality.rs    PURE: how much is drawn                governor.rs  PURE: less of it where frames come too slowly
//! wrist.rs      the wearer's panel: hung, pointed at, clicked; wrist/ its parts, PURE but for what the disk has
//! painter.rs    the renderer's parts at work: tiles chosen, made, baked, drawn; painter/ what inspect.rs changes in that
//! viewer.rs     a session, the GPU and the painter; one readable frame; viewer/ opening it, its dials, its pictures
//! capture.rs    frames of a flight to pictures      verify.rs   the GPU's heights against the CPU's
//! bench/        what a flight costs: table, JSON, page telemetry.rs spans, passes, work, memory of a frame
//! telemetry/    what a flight leaves behind: a trace, a line per frame, a histogram
//! export.rs     heights for other programs          picture.rs  PNG files that carry their address
//! at.rs         the place that `--at` names         bookmarks.rs  places by name
//! files.rs      files written whole or not at all   heap.rs     allocations, counted
//! log_lines.rs  the log's last lines, for the window    watch.rs  files that are looked at now and then
//! sound.rs      a tone that rises as one falls: sound/shepard.rs PURE, sound/voice.rs samples, sound/device.rs
//! supervisor.rs a flight kept going over lost headsets, sessions and runtimes; flying.rs the viewer under it
//! desk.rs       that flight in a window, steered by hand      cover.rs   its side of the panels
//! doctor.rs     what this machine offers            app.rs      runs a command         cli/     text to a command
//! shaders.rs    the shaders as files: written to a folder, and read from one instead of those that are built in
//! runtime_manifest.rs  the mock runtime for other applications
//! ```
//!
//! Shaders are WGSL, compiled when the program starts, and anew when a folder of them changes: `hash.wgsl` and `tile.wgsl` are the twins of
//! `terrain/{hash,surface,tile}.rs`,
//! `terrain.wgsl` of `terrain/morph.rs`, and `scene.wgsl` of `render/layout.rs`.
//!
//! Imports go downwards only: app → desk, bench, doctor → flying, cover, capture → supervisor, helm, wrist → viewer → painter → xr,
//! desktop, render, panels → gpu, and verify → render; everything may use the pure modules as plain data. `render` never names
//! OpenXR, `xr` and `desktop` never name the renderer, `mock` imports nothing of ours.
//!
//! # One frame
//!
//! Before the viewer's part ([`flying::Flying`], and [`desk::Desk`] where there is a window):
//!
//! ```text
//! take up shaders and settings that have changed
//! hand what the hands did at the frame before to the panel, then to the controllers: what the wearer wants
//! keep back what takes him elsewhere until it is dark; take pilot or flight on by the frame
//! say what is drawn over the land: hands, rays, the way back; how far the view is narrowed and faded
//! ```
//!
//! The viewer's part ([`viewer::Viewer::frame`]):
//!
//! ```text
//! poll the session's events; wait for the frame, begin it, read the hands, acquire its images
//! locate the views; place the rig: the head in tiles of the anchor
//! select the tiles to draw, from the middle of the head, for both eyes
//! choose a slice of the backdrop's next layer to bake, if one is wanted here or soon; say how fast the viewer may go on
//! record: make the missing tiles, bake
//!     place hands, rays and grid by the hands just read
//!     draw sky and backdrop into a layer of the runtime's, where it takes one and they have changed
//!     draw in one pass: what the lenses hide, all tiles at once, backdrop and sky behind them where there is no such layer,
//!         what is inspected, hands, rays and grid; several samples of a pixel become one at its end
//!     where there is a window: copy the eyes' pictures for it; narrow and fade them for the wearer, if they are to be
//!         (the other way round where the window is to show that)
//!     draw the wearer's panel: into its layer where it looks otherwise than before, or where there is none over the eyes; and
//!         into the window's copies
//! locate the views again, as late as can be; write them
//! submit; end the frame: both eyes with their depth, between the layers behind and before them
//! tell the governor what it took, and do what it says
//! ```
//!
//! After it: the hands feel what there is to feel; where there is a window, its picture is drawn from those copies and handed to
//! the window's thread, unless that is busy; the tone hears how fast one falls; the logbook has the frame.
//!
//! # Invariants
//!
//! - No floating point decides a height: CPU and GPU agree bit for bit, at every depth, on every driver.
//! - Nothing but the path grows with depth: no cost, no number, and under 3 bytes of memory per level.
//! - Nothing depends on history: blocks, tiles, whole backdrops and complete pictures are functions of the place.
//! - What is seen of the backdrop is within its parallax bound: a viewer who would outrun the baking is slowed down, but for
//!   hands that hold the land: what they hold follows them.
//! - No drawn tile touches one that is two levels coarser, and no vertex of an edge differs between its two sides.
//! - No slot of the pool is refilled before the frames that draw it: the queue's order and one barrier see to it.
//! - No frame of the session that was begun stays open, on any way out.
//! - No frame lays out, draws or acquires anything for a panel that is hidden, or that looks as it did.
//! - No frame waits for a window, and no end for a display that hangs.
//! - No queue is held while the session waits; no `unsafe` outside `gpu/`, `xr/`, `mock/` and the allocator in `heap.rs`.
//! - No panic for what the world can make fail: OpenXR, Vulkan, files, input.

pub mod address;
pub mod aids;
pub mod app;
pub mod at;
pub mod bench;
pub mod bindings;
pub mod bookmarks;
pub mod capture;
pub mod cli;
pub mod comfort;
pub mod controllers;
pub mod course;
pub mod cover;
pub mod desk;
pub mod desktop;
pub mod doctor;
pub mod export;
pub mod files;
pub mod flight;
pub mod flying;
pub mod governor;
pub mod gpu;
pub mod heap;
pub mod helm;
pub mod input;
pub mod inspect;
pub mod log_lines;
pub mod mock;
mod painter;
pub mod panels;
pub mod picture;
pub mod pilot;
pub mod quality;
pub mod render;
pub mod rig;
pub mod runtime_manifest;
pub mod settings;
pub mod shaders;
pub mod sound;
pub mod supervisor;
pub mod telemetry;
pub mod terrain;
pub mod verify;
pub mod viewer;
pub mod watch;
pub mod world;
pub mod wrist;
pub mod xr;
pub mod yardstick;
