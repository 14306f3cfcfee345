//! The window's picture is what the eyes see, cropped, turned and laid over as it should be; and no window, however it
//! behaves, holds up the frames that are drawn beside it.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]
#![allow(unsafe_code, reason = "a counting allocator")]

mod support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use ash::vk;
use fathomless::at;
use fathomless::desktop::{Composer, Mirror, Scene, Sights, Spectator};
use fathomless::gpu::{
    Access, Attachment, Buffer, BufferInfo, Canvas, Commands, Frames, Gpu, GraphicsInfo, GraphicsPipeline,
    Image, ImageInfo, Load, Location, Presenter, Program, Shown, Source, Target, Transition,
};
use fathomless::mock::{Mock, MockConfig};
use fathomless::settings::Side;
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;
use glam::DQuat;
use raw_window_handle::{DisplayHandle, HandleError, HasDisplayHandle, HasWindowHandle, WindowHandle};
use support::{assert_clean, gpu};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what each thread takes from the heap.
struct Counting;

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // A thread may allocate while its locals are already gone.
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: passed on as it came.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: passed on as it came.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Texels per side of an eye's picture.
const SIDE: u32 = 128;

/// Wider to the left than to the right, as a headset's left eye.
const FOV: [f32; 4] = [-0.85, 0.7, 0.75, -0.8];

/// Red grows to the right and green downwards, by the share of the picture; the right eye's has all its blue.
const GRADIENT: Source<'_> = Source {
    name: "gradient.wgsl",
    text: "
var<immediate> blue: vec4<f32>;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4(at.xy / 128.0, blue.x, 0.25);
}
",
};

fn drawable(gpu: &Arc<Gpu>, name: &str, size: [u32; 2], layers: u32) -> Image {
    let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
        | vk::ImageUsageFlags::SAMPLED
        | vk::ImageUsageFlags::TRANSFER_SRC;
    let format = Presenter::FORMAT;
    let [width, height] = size;
    Image::new(gpu, &ImageInfo { name, width, height, layers, format, usage, ..ImageInfo::default() })
        .unwrap()
}

const DRAWN: (Access, vk::ImageLayout) = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);

fn into(
    commands: Commands<'_>,
    image: &Image,
    from: (Access, vk::ImageLayout),
    to: (Access, vk::ImageLayout),
) {
    commands.transition(&[Transition { image: image.raw, aspect: vk::ImageAspectFlags::COLOR, from, to }]);
}

/// Both eyes' pictures, as the viewer leaves them.
fn eyes(gpu: &Arc<Gpu>) -> Image {
    let image = drawable(gpu, "eyes", [SIDE, SIDE], 2);
    let program = Program::new(gpu, "gradient", &[GRADIENT], &[]).unwrap();
    let pipeline =
        GraphicsPipeline::new(&GraphicsInfo::new(&program, "vertex", "fragment", &[Presenter::FORMAT]))
            .unwrap();
    gpu.run(|commands| {
        into(commands, &image, (Access::NONE, vk::ImageLayout::UNDEFINED), DRAWN);
        for (view, blue) in image.layer_views.iter().zip([0.0f32, 1.0]) {
            let colour = [Attachment::new(*view, DRAWN.1, Load::Discard)];
            let target = Target { extent: image.extent, view_mask: 0, colour: &colour, depth: None };
            commands.render(&target, |pass| {
                pass.bind(&pipeline, &[]);
                pass.push(&pipeline, &[blue; 4]);
                pass.draw(3, 1);
            });
        }
        let kept = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        into(commands, &image, DRAWN, kept);
    })
    .unwrap();
    image
}

/// Half of a red glass, multiplied by its alpha.
fn glass(gpu: &Arc<Gpu>) -> Image {
    let image = drawable(gpu, "glass", [8, 8], 1);
    gpu.run(|commands| {
        into(commands, &image, (Access::NONE, vk::ImageLayout::UNDEFINED), DRAWN);
        let colour = [Attachment::new(image.layer_views[0], DRAWN.1, Load::Colour([0.5, 0.0, 0.0, 0.5]))];
        let target = Target { extent: image.extent, view_mask: 0, colour: &colour, depth: None };
        commands.render(&target, |_| ());
        into(commands, &image, DRAWN, (Access::FRAGMENT_READ, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL));
    })
    .unwrap();
    image
}

/// A window's picture: red, green, blue, alpha, from 0 to 1, rows from the top.
/// All pixels of an image.
fn whole(image: &Image) -> [u32; 2] {
    [image.extent.width, image.extent.height]
}

fn compose(gpu: &Arc<Gpu>, scene: &Scene<'_>, sights: Sights, size: [u32; 2]) -> Vec<[f64; 4]> {
    let mut composer = Composer::new(gpu).unwrap();
    let mut frames = Frames::new(gpu, 2).unwrap();
    let image = drawable(gpu, "window", size, 1);
    let buffer = Buffer::new(
        gpu,
        &BufferInfo {
            name: "pixels",
            size: 4 * u64::from(size[0] * size[1]),
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Readback,
        },
    )
    .unwrap();
    let mut frame = frames.begin().unwrap();
    into(frame.commands(), &image, (Access::NONE, vk::ImageLayout::UNDEFINED), DRAWN);
    let canvas = Canvas { index: 1, view: image.layer_views[0], extent: image.extent };
    composer.record(&mut frame, canvas, scene, sights.panes(size)).unwrap();
    let read = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    into(frame.commands(), &image, DRAWN, read);
    let layers = vk::ImageSubresourceLayers {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        mip_level: 0,
        base_array_layer: 0,
        layer_count: 1,
    };
    let all = vk::BufferImageCopy::default().image_subresource(layers).image_extent(image.extent.into());
    frame.commands().copy_image_to_buffer((image.raw, read.1), &buffer, &[all]);
    frame.commands().barrier(Access::COPY_WRITE, Access::HOST_READ);
    frames.submit(frame, &[], &[]).unwrap();
    frames.wait_idle().unwrap();
    let share = |byte: u8| f64::from(byte) / 255.0;
    buffer.slice::<[u8; 4]>().iter().map(|&[b, g, r, a]| [r, g, b, a].map(share)).collect()
}

#[test]
fn the_windows_picture_is_what_its_panes_say() {
    let gpu = gpu();
    let (eyes, glass) = (eyes(&gpu), glass(&gpu));
    let turn = DQuat::from_rotation_y(0.06) * DQuat::from_rotation_x(-0.04) * DQuat::from_rotation_z(0.1);
    let fov = [FOV, [-FOV[1], -FOV[0], FOV[2], FOV[3]]];
    for (side, eye_from_spectator, overlay) in [
        (Side::Left, None, None),
        (Side::Right, None, Some(&glass)),
        (Side::Both, None, None),
        (Side::Spectator, None, None),
        (Side::Spectator, Some(turn), None),
        (Side::Spectator, Some(turn), Some(&glass)),
    ] {
        let sights = Sights { side, fov, eye_from_spectator };
        for size in [[160, 100], [37, 90]] {
            let picture = compose(&gpu, &Scene { eyes: &eyes, drawn: whole(&eyes), overlay }, sights, size);
            for pane in sights.panes(size) {
                assert!(pane.is_filled(), "{side:?}");
                let [left, top, right, bottom] = pane.window;
                for (x, y) in (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y))) {
                    let within =
                        |at: i32, from: i32, to: i32| (f64::from(at - from) + 0.5) / f64::from(to - from);
                    let place = [within(x, left, right), within(y, top, bottom)];
                    let [u, v] = pane.picture_at(place).unwrap();
                    let mut expected = [u, v, pane.eye as f64];
                    if overlay.is_some() {
                        expected = [0.5 * u + 0.5, 0.5 * v, 0.5 * expected[2]];
                    }
                    let shown = picture[(y * size[0] as i32 + x) as usize];
                    for (shown, expected) in shown.iter().zip(expected) {
                        // Rounded twice, and half a texel at the edge.
                        let error = (shown - expected).abs();
                        assert!(error < 0.009, "{side:?} {size:?} {x} {y}: {shown} is not {expected}");
                    }
                    assert_eq!(shown[3], 1.0, "{side:?} {x} {y}");
                }
            }
        }
    }
    drop((eyes, glass));
    assert_clean(gpu);
}

/// A window that takes no pictures.
struct Blind;

impl HasWindowHandle for Blind {
    fn window_handle(&self) -> Result<WindowHandle<'_>, HandleError> {
        Err(HandleError::Unavailable)
    }
}

impl HasDisplayHandle for Blind {
    fn display_handle(&self) -> Result<DisplayHandle<'_>, HandleError> {
        Err(HandleError::Unavailable)
    }
}

/// A window that answers no question until it is let go, or [`HANGS_FOR`] is over.
#[derive(Default)]
struct Hung {
    asked: Mutex<Asked>,
    changed: Condvar,
}

/// What a window that hangs was asked.
#[derive(Default)]
struct Asked {
    /// Questions so far, and those of them that nobody waits for an answer to any more.
    begun: usize,
    ended: usize,
    is_free: bool,
}

/// Longer than anything takes here: whoever waits for the window finds that it has been answered.
const HANGS_FOR: Duration = Duration::from_secs(300);

impl Hung {
    fn let_go(&self) {
        self.asked.lock().unwrap().is_free = true;
        self.changed.notify_all();
    }

    /// Waits until somebody waits for an answer.
    fn wait_asked(&self) {
        let asked = self.asked.lock().unwrap();
        let wait = self.changed.wait_timeout_while(asked, HANGS_FOR, |asked| asked.begun == 0);
        assert!(!wait.unwrap().1.timed_out(), "nobody asks the window anything");
    }

    fn has_answered(&self) -> bool {
        self.asked.lock().unwrap().ended > 0
    }
}

impl HasWindowHandle for Hung {
    fn window_handle(&self) -> Result<WindowHandle<'_>, HandleError> {
        Err(HandleError::Unavailable)
    }
}

impl HasDisplayHandle for Hung {
    fn display_handle(&self) -> Result<DisplayHandle<'_>, HandleError> {
        let mut asked = self.asked.lock().unwrap();
        asked.begun += 1;
        self.changed.notify_all();
        let wait = self.changed.wait_timeout_while(asked, HANGS_FOR, |asked| !asked.is_free);
        wait.unwrap().0.ended += 1;
        Err(HandleError::Unavailable)
    }
}

/// Tries, 2 ms apart at least, before a window's thread counts as stuck: a minute.
const PATIENCE: usize = 30_000;

const LEFT: Sights = Sights { side: Side::Left, fov: [FOV; 2], eye_from_spectator: None };

#[test]
fn a_window_that_takes_nothing_costs_no_frame_and_no_memory_at_any_size() {
    let gpu = gpu();
    let eyes = eyes(&gpu);
    let scene = Scene { eyes: &eyes, drawn: whole(&eyes), overlay: None };
    let mut mirror = Mirror::new(&gpu, &Arc::new(Blind)).unwrap();
    let sizes = [[64, 48], [1, 1], [0, 0], [0, 9], [500, 3], [1, 300], [64, 48], [63, 48]];
    for size in sizes.into_iter().cycle().take(40) {
        let mut shown = 0;
        for _ in 0..PATIENCE {
            match mirror.show(&scene, LEFT, size).unwrap() {
                Shown::Yes => shown += 1,
                Shown::Skipped => std::thread::sleep(Duration::from_millis(2)),
            }
            if shown == 3 || size.contains(&0) {
                break;
            }
        }
        // Pictures come back, shown or not; none is drawn where there is nothing to see.
        assert_eq!(shown, if size.contains(&0) { 0 } else { 3 }, "{size:?}");
    }
    let camera = Spectator::at(DQuat::from_rotation_y(0.05)).eye_from_camera(DQuat::IDENTITY);
    let sights = Sights { side: Side::Spectator, eye_from_spectator: Some(camera), ..LEFT };
    let mut show = |pictures: usize| {
        let mut drawn = 0;
        for _ in 0..PATIENCE {
            drawn += usize::from(mirror.show(&scene, sights, [64, 48]).unwrap() == Shown::Yes);
            if drawn == pictures {
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        assert_eq!(drawn, pictures);
    };
    show(5);
    let before = ALLOCATIONS.get();
    show(20);
    let allocated = ALLOCATIONS.get() - before;
    assert_eq!(allocated, 0, "allocations");
    mirror.wait_drawn().unwrap();
    drop((mirror, eyes));
    assert_clean(gpu);
}

#[test]
fn a_window_that_hangs_does_not_hold_up_the_headset_nor_the_end() {
    let mock = Mock::new(MockConfig { eye_size: [32, 32], keep_frames: 1000, ..MockConfig::default() });
    let world = World::load("hills").unwrap();
    let config = ViewerConfig { complete: false, ..ViewerConfig::default() };
    let mut viewer = Viewer::on_mock(&world, &config, mock.clone()).unwrap();
    viewer.keep_mirror().unwrap();
    let hung = Arc::new(Hung::default());
    let mut mirror = Mirror::new(viewer.gpu(), &hung).unwrap();
    let stand = at::stand(&world, 0, None);
    let mut fly = |mirror: &mut Mirror, frames: usize| {
        let (mut drawn, mut shown) = (0, 0);
        while drawn < frames {
            if viewer.frame(&stand.standpoint(), true).unwrap() != Step::Drew {
                continue;
            }
            drawn += 1;
            let Some(eyes) = viewer.mirror() else { continue };
            let sights = Sights { fov: [viewer.eye(0).unwrap().fov; 2], ..LEFT };
            let scene = Scene { eyes, drawn: whole(eyes), overlay: None };
            shown += usize::from(mirror.show(&scene, sights, [200, 120]).unwrap() == Shown::Yes);
        }
        shown
    };
    // One that the thread hangs with, and one that waits for it.
    assert_eq!(fly(&mut mirror, 10), Presenter::IN_FLIGHT);
    hung.wait_asked();
    assert_eq!(fly(&mut mirror, 60), 0, "pictures for a window that takes none");
    assert!(!hung.has_answered(), "the frames have waited for the window");
    assert!(mock.take_frames().len() >= 70);
    mirror.wait_drawn().unwrap();
    drop(mirror);
    assert!(!hung.has_answered(), "the end has waited for the window");
    hung.let_go();
}
