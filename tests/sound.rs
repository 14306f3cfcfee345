//! The tone rises for ever and stays where it is, has no click in it, follows the fall, is silent at rest, at a jump and where
//! no frames come any more; and a device that fails is opened again.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::cell::{Cell, RefCell};
use std::f64::consts::TAU;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use fathomless::sound::shepard::{LOWEST_HZ, PARTIALS, RISE, Shepard, Wanted, bell, loudness};
use fathomless::sound::{Player, Sound, SoundSettings, Voice, Wishes};

const RATE: f32 = 48_000.0;

fn full(depth: f64) -> Wanted {
    Wanted { depth, loudness: 1.0 }
}

/// So many seconds of a fall, from a depth in octaves, at so many of them per second; the first second is left out.
fn fall(from: f64, speed: f64, seconds: f64) -> Vec<f32> {
    let mut tone = Shepard::new(RATE);
    let samples = ((seconds + 1.0) * f64::from(RATE)) as usize;
    let all = (0..samples).map(|i| tone.next(&full(from + speed * i as f64 / f64::from(RATE))));
    all.collect::<Vec<_>>().split_off(RATE as usize)
}

/// Amplitude of a frequency in samples, under a Hann window.
fn amplitude(samples: &[f32], hz: f64) -> f64 {
    let n = samples.len() as f64;
    let (sin, cos) = (TAU * hz / f64::from(RATE)).sin_cos();
    let (mut sum, mut at) = ([0.0; 2], [1.0, 0.0]);
    for (i, sample) in samples.iter().enumerate() {
        let window = 1.0 - (TAU * i as f64 / n).cos();
        sum[0] += window * f64::from(*sample) * at[0];
        sum[1] += window * f64::from(*sample) * at[1];
        at = [at[0] * cos - at[1] * sin, at[0] * sin + at[1] * cos];
    }
    2.0 / n * sum[0].hypot(sum[1])
}

/// Hertz of a partial while the tone stands still at a depth.
fn partial_hz(depth: f64, i: usize) -> f64 {
    f64::from(LOWEST_HZ) * ((depth * RISE).rem_euclid(1.0) + i as f64).exp2()
}

fn power(samples: &[f32]) -> f64 {
    samples.iter().map(|s| f64::from(s * s)).sum::<f64>() / samples.len() as f64
}

#[test]
fn partials_stand_an_octave_apart_under_a_bell_and_there_is_nothing_else() {
    for depth in [0.0, 1.3, -2.9, 100_000.7] {
        let samples = fall(depth, 0.0, 1.0);
        let octaves = |i: usize| ((depth * RISE).rem_euclid(1.0) + i as f64) as f32;
        let strongest = (0..PARTIALS).map(|i| bell(octaves(i))).fold(0.0, f32::max);
        let found: Vec<f64> = (0..PARTIALS).map(|i| amplitude(&samples, partial_hz(depth, i))).collect();
        let loudest = found.iter().copied().fold(0.0, f64::max);
        assert!(loudest > 0.1, "{found:?}");
        for (i, found) in found.iter().enumerate() {
            let expected = f64::from(bell(octaves(i)) / strongest);
            assert!(
                (found / loudest - expected).abs() < 0.02,
                "depth {depth}, partial {i}: {found} of {loudest}"
            );
        }
        let theirs: f64 = found.iter().map(|a| a * a / 2.0).sum();
        let all = power(&samples);
        assert!((all - theirs).abs() < 0.02 * all, "depth {depth}: {theirs} of a power of {all}");
        assert!(samples.iter().all(|s| s.abs() <= 1.0));
    }
}

#[test]
fn it_rises_for_ever_and_stays_where_it_is() {
    // Six octaves of the tone itself.
    let (speed, seconds) = (1.0, 6.0 / RISE);
    let samples = fall(0.0, speed, seconds);
    let (each_s, phases) = (0.5f32, 24u32);
    let mut last: Option<f64> = None;
    let mut centres = Vec::new();
    for (i, part) in samples.chunks_exact((each_s * RATE) as usize).enumerate() {
        let part = &part[..RATE as usize / 8];
        let energies = |phase: usize| {
            let octaves = |k: usize| phase as f64 / f64::from(phases) + k as f64;
            let energy = |k| amplitude(part, f64::from(LOWEST_HZ) * octaves(k).exp2()).powi(2);
            std::array::from_fn::<f64, PARTIALS, _>(energy)
        };
        // Where the partials are within their octave: the place that has most of the energy.
        let all = (0..phases as usize).map(|phase| (phase, energies(phase)));
        let sum = |each: &[f64; PARTIALS]| each.iter().sum::<f64>();
        let (phase, each) = all.max_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1))).unwrap();
        let phase = phase as f64 / f64::from(phases);
        if let Some(last) = last.replace(phase) {
            let step = (phase - last).rem_euclid(1.0);
            let expected = f64::from(each_s) * RISE * speed;
            assert!((step - expected).abs() < 1.5 / f64::from(phases), "part {i}: a step of {step} octaves");
        }
        // The mean of the octaves, by their energy: what "high" and "low" mean for an ear.
        let octaves = each.iter().enumerate().map(|(k, energy)| (phase + k as f64) * energy);
        centres.push(octaves.sum::<f64>() / sum(&each));
    }
    assert!(centres.len() > 40);
    let (low, high) = centres.iter().fold((f64::MAX, f64::MIN), |(l, h), c| (l.min(*c), h.max(*c)));
    println!("the middle of the tone stays between {low:.2} and {high:.2} octaves above {LOWEST_HZ} Hz");
    assert!(high - low < 0.35, "the tone wanders from {low} to {high} octaves");
}

/// The largest step between samples, and the largest change of a step: a click is one of the latter.
fn roughest(samples: &[f32]) -> f32 {
    samples.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).fold(0.0, f32::max)
}

#[test]
fn nothing_clicks_where_partials_come_and_go_nor_at_a_leap() {
    // What the partials themselves make, all at their highest at once: Σ a (2π f / rate)².
    let bend = |phase: f32| {
        let part = |i: usize| {
            let turn = std::f32::consts::TAU * LOWEST_HZ * (phase + i as f32).exp2() / RATE;
            bell(phase + i as f32) * turn * turn
        };
        (0..PARTIALS).map(part).sum::<f32>()
    };
    let most = (0..100).map(|p| bend(p as f32 / 100.0)).fold(0.0, f32::max) / 4.0;
    // Down through eight wraps, and up again.
    for speed in [4.0, -4.0] {
        let rough = roughest(&fall(0.0, speed, 8.0));
        assert!(rough < 1.05 * most, "{speed} octaves/s: {rough} of at most {most}");
    }
    // To another end of the world in the middle of a sound.
    let mut tone = Shepard::new(RATE);
    let there = |i: usize| if i < 48_000 { 12.3 } else { 700_000.95 };
    let samples: Vec<f32> = (0..96_000).map(|i| tone.next(&full(there(i)))).collect();
    assert!(roughest(&samples) < 1.05 * most);
    // And where it begins and ends.
    let mut tone = Shepard::new(RATE);
    let loud =
        |i: usize| Wanted { depth: 3.0, loudness: if (20_000..60_000).contains(&i) { 1.0 } else { 0.0 } };
    let samples: Vec<f32> = (0..160_000).map(|i| tone.next(&loud(i))).collect();
    assert!(roughest(&samples) < 1.05 * most);
    assert!(samples[..20_000].iter().all(|s| *s == 0.0));
    assert!(power(&samples[40_000..60_000]) > 0.005);
    assert!(samples[159_000..].iter().all(|s| s.abs() < 0.02), "it does not end");
}

#[test]
fn the_same_wishes_are_the_same_tone_and_no_number_breaks_it() {
    assert_eq!(fall(7.7, 1.5, 0.5), fall(7.7, 1.5, 0.5));
    let mut tone = Shepard::new(RATE);
    for (depth, loudness) in [(f64::NAN, 1.0), (f64::INFINITY, f32::NAN), (1e300, 5.0), (-1e6, -1.0)] {
        for _ in 0..1000 {
            let sample = tone.next(&Wanted { depth, loudness });
            assert!(sample.is_finite() && sample.abs() <= 1.0, "{depth} {loudness}: {sample}");
        }
    }
}

#[test]
fn it_is_as_loud_as_the_fall_is_fast_and_silent_at_rest() {
    assert_eq!(loudness(0.0), 0.0);
    assert!((0..40).all(|i| loudness(f64::from(i)) < loudness(f64::from(i + 1))));
    assert!(loudness(1e9) <= 1.0 && loudness(-2.0) == loudness(2.0) && loudness(f64::NAN) == 0.0);

    let mut sound = Sound::on(Box::new(|_| Err("there is none".to_owned())));
    let fly = |sound: &mut Sound, from: f64, speed: f64| {
        let mut depth = from;
        for _ in 0..90 {
            depth += speed * FRAME.as_secs_f64();
            sound.follow(depth, FRAME, false);
        }
        depth
    };
    // Off, until it is set otherwise.
    fly(&mut sound, 0.0, 1.5);
    assert_eq!(sound.wanted().loudness, 0.0);

    sound.set(&SoundSettings { volume: 0.5 });
    let depth = fly(&mut sound, 2.0, 1.5);
    let wanted = sound.wanted();
    assert_eq!(wanted.depth, depth);
    assert!((wanted.loudness - 0.5 * loudness(1.5)).abs() < 0.01, "{wanted:?}");
    // A jump is no fall, however short; and a fall is no jump, however fast.
    for there in [50_000.0, depth + 2.0, depth + 0.01] {
        sound.follow(there, FRAME, true);
        assert_eq!(sound.wanted(), Wanted { depth: there, loudness: 0.0 });
        sound.follow(there, FRAME, false);
        assert_eq!(sound.wanted().loudness, 0.0, "what follows a jump");
    }
    sound.follow(depth + 20.0, FRAME, false);
    assert!(sound.wanted().loudness > 0.4);
    // Frames of no length, and at rest.
    sound.follow(50_001.0, Duration::ZERO, false);
    fly(&mut sound, 50_001.0, 0.0);
    assert!(sound.wanted().loudness < 1e-3, "{:?}", sound.wanted());
}

/// A frame of a headset.
const FRAME: Duration = Duration::from_nanos(11_111_111);

/// The loudest of a buffer.
fn peak(samples: &[f32]) -> f32 {
    samples.iter().fold(0.0, |peak, sample| sample.abs().max(peak))
}

#[test]
fn without_frames_it_fades_and_with_them_it_is_back() {
    for buffer in [64, 512, 4800] {
        let wishes = Arc::new(Wishes::default());
        let mut voice = Voice::new(Arc::clone(&wishes), RATE);
        let mut samples = vec![0.0; 2 * buffer];
        let mut play = |seconds: f64, wanted: Option<Wanted>| {
            let mut all = Vec::new();
            for i in 0..(seconds * f64::from(RATE) / buffer as f64) as usize {
                // A frame in each thousand samples, or none at all.
                if let Some(wanted) = wanted.filter(|_| i % (1000 / buffer).max(1) == 0) {
                    wishes.set(&wanted);
                }
                voice.fill(&mut samples, 2, |sample| sample);
                assert!(samples.chunks(2).all(|both| both[0] == both[1]), "the channels differ");
                all.extend(samples.iter().step_by(2));
            }
            all
        };
        let loud = peak(&play(2.0, Some(full(3.3)))[RATE as usize..]);
        assert!(loud > 0.2, "{loud}");
        // A frame may take its time.
        let short = play(0.25, None);
        assert!(peak(&short[short.len() / 2..]) > 0.9 * loud, "buffers of {buffer}: a long frame is heard");
        let lost = play(3.0, None);
        assert!(peak(&lost[2 * RATE as usize..]) < 0.02 * loud, "buffers of {buffer}: it drones on");
        let back = play(1.0, Some(full(3.3)));
        assert!(peak(&back[back.len() / 2..]) > 0.9 * loud, "buffers of {buffer}: it stays away");
        // Nothing clicks on the way.
        let bend = roughest(&[short, lost, back].concat());
        assert!(bend < 0.05, "{bend}");
    }
    // Few buffers a second are no sign of missing frames.
    let wishes = Arc::new(Wishes::default());
    let mut voice = Voice::new(Arc::clone(&wishes), RATE);
    let mut samples = vec![0.0; 2 * RATE as usize];
    for _ in 0..3 {
        wishes.set(&full(1.0));
        voice.fill(&mut samples, 1, |sample| sample);
        assert!(peak(&samples[samples.len() - 4800..]) > 0.2);
    }
}

/// What became of the devices that were opened.
#[derive(Default)]
struct Desk {
    opened: Cell<u32>,
    /// The one that plays goes on doing so.
    works: Cell<bool>,
    /// None: there is a device to open.
    refuses: RefCell<Option<String>>,
}

struct Device(Rc<Desk>);

impl Player for Device {
    fn plays(&self) -> bool {
        self.0.works.get()
    }

    fn why(self: Box<Device>) -> String {
        "it was unplugged".to_owned()
    }
}

#[test]
fn a_device_that_fails_is_opened_again_after_a_pause_and_only_where_one_is_wanted() {
    let desk = Rc::new(Desk::default());
    let there = Rc::clone(&desk);
    let mut sound = Sound::on(Box::new(move |_| {
        there.opened.set(there.opened.get() + 1);
        match &*there.refuses.borrow() {
            Some(why) => Err(why.clone()),
            None => Ok(Box::new(Device(Rc::clone(&there)))),
        }
    }));
    desk.works.set(true);
    let fly = |sound: &mut Sound, seconds: f64| {
        let before = desk.opened.get();
        (0..(seconds / FRAME.as_secs_f64()) as usize).for_each(|_| sound.follow(1.0, FRAME, false));
        desk.opened.get() - before
    };
    assert_eq!(fly(&mut sound, 20.0), 0, "nobody asked for one");
    sound.set(&SoundSettings { volume: 0.3 });
    assert_eq!((fly(&mut sound, 20.0), desk.opened.get()), (0, 1));
    assert!(sound.plays());
    // One that fails after it has played for a while is replaced at once; one that fails at once, after a pause.
    desk.works.set(false);
    assert_eq!(fly(&mut sound, 0.05), 1);
    assert!(!sound.plays());
    assert_eq!(fly(&mut sound, 4.5), 0);
    *desk.refuses.borrow_mut() = Some("there is no audio device".to_owned());
    let tried = fly(&mut sound, 60.0);
    assert!((11..=13).contains(&tried), "tried {tried} times a minute");
    // What is silent needs none; whoever turns it on has one right away.
    sound.set(&SoundSettings { volume: 0.0 });
    assert_eq!(fly(&mut sound, 20.0), 0);
    *desk.refuses.borrow_mut() = None;
    desk.works.set(true);
    sound.set(&SoundSettings { volume: 0.3 });
    assert!(sound.plays());
    assert_eq!(fly(&mut sound, 60.0), 0);
}
