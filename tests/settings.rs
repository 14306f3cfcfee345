//! Settings: the manual is complete and true, later layers win and say where they come from, what is wrong is said with
//! its place and what would be right, changes of files are noticed, and saving keeps what a person wrote.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fathomless::cli::{self, Action as Asked, Stop};
use fathomless::pilot::MotionSettings;
use fathomless::settings::{
    Action, Button, InForce, Key, MANUAL, Named, Place, RuntimeChoice, Settings, Side, Sources, Surroundings,
    VARIABLES_OF_OTHERS, Watch, edit, entries, save_to,
};
use fathomless::watch;
use tempfile::TempDir;
use toml::Value;

/// A home with these settings of its user.
fn home(text: &str) -> (TempDir, Sources) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("fathomless.toml"), text).unwrap();
    let around = Surroundings { folder: Some(folder.path().to_owned()), variables: Vec::new() };
    (folder, Sources { around, ..Sources::default() })
}

fn sets(sets: &[&str]) -> Sources {
    Sources { sets: sets.iter().map(ToString::to_string).collect(), ..Sources::default() }
}

fn variables(all: &[(&str, &str)]) -> Sources {
    let variables = all.iter().map(|(name, value)| (OsString::from(name), OsString::from(value))).collect();
    Sources { around: Surroundings { folder: None, variables }, ..Sources::default() }
}

fn place<'a>(in_force: &'a InForce, path: &str) -> &'a Place {
    &in_force.lines.iter().find(|line| line.path == path).unwrap().place
}

/// The file's settings are refused, in one line with all these words.
fn refused(sources: &Sources, words: &[&str]) {
    let problem = sources.load().expect_err("something is wrong with it").to_string();
    assert_eq!(problem.lines().count(), 1, "{problem}");
    for word in words {
        assert!(problem.contains(word), "{word:?} expected: {problem}");
    }
}

/// Names of settings and their values, as nested tables have them.
fn flat(prefix: &str, table: &toml::Table, to: &mut Vec<(String, Value)>) {
    for (name, value) in table {
        let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        match value {
            Value::Table(inner) => flat(&path, inner, to),
            value => to.push((path, value.clone())),
        }
    }
}

fn flattened(table: &toml::Table) -> Vec<(String, Value)> {
    let mut all = Vec::new();
    flat("", table, &mut all);
    all.sort_by(|one, two| one.0.cmp(&two.0));
    all
}

#[test]
fn the_manual_names_every_setting_once_and_is_what_is_built_in() {
    let manual = flattened(&toml::from_str(MANUAL).unwrap());
    let names: BTreeSet<&str> = manual.iter().map(|(name, _)| name.as_str()).collect();
    let known: BTreeSet<&str> = entries().iter().map(|entry| entry.path.as_str()).collect();
    assert_eq!(names, known, "what the manual names, and what is taken");
    assert_eq!(manual.len(), entries().len(), "once each");

    // The program's own type has the same settings, no more and no fewer, with the same values.
    let own = flattened(&toml::Table::try_from(Settings::default()).unwrap());
    assert_eq!(own.len(), manual.len());
    for ((name, built_in), (same_name, written)) in own.iter().zip(&manual) {
        assert_eq!(name, same_name);
        let number = |value: &Value| value.as_float().or(value.as_integer().map(|n| n as f64));
        match (number(built_in), number(written)) {
            (Some(one), Some(two)) => assert!((one - two).abs() < 1e-6, "{name}: {one} {two}"),
            _ => assert_eq!(built_in, written, "{name}"),
        }
    }
    assert_eq!(Settings::default().motion, MotionSettings::default());
    assert_eq!(Settings::default().motion.checked(), MotionSettings::default());
}

/// Each line of the manual ends with what its setting takes, or what its action does, and that is true.
#[test]
fn the_manual_says_what_each_setting_takes() {
    let mut section = String::new();
    let mut told = 0;
    for line in MANUAL.lines() {
        if let Some(heading) = line.strip_prefix('[') {
            section = heading.split(']').next().unwrap().to_owned();
            continue;
        }
        let Some((name, rest)) = line.split_once(" = ").filter(|_| !line.starts_with('#')) else { continue };
        let (path, comment) = (format!("{section}.{name}"), rest.split_once("# ").unwrap().1);
        let rule = entries().iter().find(|entry| entry.path == path).unwrap().rule;
        match Action::find(name).filter(|_| section == "keys" || section == "gamepad.buttons") {
            Some(action) => assert_eq!(comment, action.does(), "{path}"),
            None if section == "gamepad.axes" => assert!(comment.len() > 8, "{path}"),
            None => assert_eq!(comment, rule.to_string(), "{path}"),
        }
        told += 1;
    }
    assert_eq!(told, entries().len());
    for name in Button::all().iter().map(|(name, _)| name) {
        assert!(MANUAL.contains(&format!("\"{name}\"")), "the manual names the button {name}");
    }
    let ranges = ["A", "Z", "0", "9", "F1", "F12", "Numpad0", "Numpad9"];
    for (name, _) in Key::all().iter().filter(|(name, _)| name.len() > 3 || ranges.contains(name)) {
        let listed = name.starts_with("Numpad") && name.len() == 7 || MANUAL.contains(&format!("\"{name}\""));
        assert!(listed, "the manual names the key {name}");
    }
}

/// Both ends of every range are taken and no more, also by what the settings are read into.
#[test]
fn every_range_is_kept() {
    let mut tried = 0;
    for entry in entries() {
        let rule = entry.rule.to_string();
        let Some((_, range)) = rule.split_once("number from ") else { continue };
        let (least, most) = range.split_once(" to ").unwrap();
        let [least, most] = [least, most].map(|number| number.parse::<f64>().unwrap());
        for inside in [least, most] {
            sets(&[&format!("{}={inside}", entry.path)]).load().unwrap_or_else(|problem| panic!("{problem}"));
        }
        for outside in [least - 1.0, most + 1.0] {
            refused(&sets(&[&format!("{}={outside}", entry.path)]), &[&format!("`{}`", entry.path), &rule]);
        }
        for wrong in ["true", "[]", "nan", "\"many\"", "{}"] {
            refused(&sets(&[&format!("{}={wrong}", entry.path)]), &[&rule]);
        }
        tried += 1;
    }
    assert!(tried >= 25, "{tried}");
}

#[test]
fn later_layers_win_and_say_where_they_are() {
    let (folder, mut sources) =
        home("[motion]\nspeed = 2\nslide = 3\nturn_rate = 4\nroll_rate = 5\n# so\n  inertia_s = 1\n");
    let config = folder.path().join("other.toml");
    fs::write(&config, "motion.slide = 13\nmotion.turn_rate = 14\nmotion.roll_rate = 15\n").unwrap();
    sources.config = Some(config.clone());
    sources.sets = vec!["motion.turn_rate=24".to_owned(), "motion.roll_rate=25".to_owned()];
    sources.around.variables = vec![("FATHOMLESS_MOTION_ROLL_RATE".into(), "35".into())];
    let loaded = sources.load().unwrap();
    let motion = loaded.settings.motion;
    assert_eq!((motion.speed, motion.slide, motion.turn_rate, motion.roll_rate), (2.0, 13.0, 24.0, 35.0));
    let at = |path| place(&loaded, path).to_string();
    assert_eq!(at("motion.comfort_m"), "built in");
    assert_eq!(at("motion.inertia_s"), format!("{}:7:15", folder.path().join("fathomless.toml").display()));
    assert_eq!(at("motion.slide"), format!("{}:1:16", config.display()));
    assert_eq!(at("motion.turn_rate"), "--set motion.turn_rate=24");
    assert_eq!(at("motion.roll_rate"), "FATHOMLESS_MOTION_ROLL_RATE");
    let differing: Vec<_> =
        loaded.differing(&Sources::default().load().unwrap()).map(str::to_owned).collect();
    let all = ["motion.speed", "motion.inertia_s", "motion.turn_rate", "motion.roll_rate", "motion.slide"];
    assert_eq!(differing, all);
}

#[test]
fn options_of_the_command_line_win_over_all_settings() {
    let (_folder, sources) =
        home("[view]\nruntime = 'mock'\nsize = '64x48'\nvalidate = true\nrefresh_rate = 72\n");
    let view = |args: &[&str]| {
        let args = ["fathomless", "view"].iter().chain(args);
        match cli::parse_within(args, sources.around.clone()) {
            Ok(cli::Command { action: Asked::View(view), validate, .. }) => (view, validate),
            other => panic!("{other:?}"),
        }
    };
    let (plain, validate) = view(&[]);
    assert!(validate && plain.settings.settings.view.runtime == RuntimeChoice::Mock);
    assert_eq!(plain.settings.settings.view.refresh_rate, Some(72.0));
    let (asked, _) =
        view(&["--runtime", "auto", "--size", "8x9", "--refresh-rate", "120", "--set", "view.size=7x7"]);
    let set = asked.settings.settings.view;
    assert_eq!((set.runtime, set.refresh_rate), (RuntimeChoice::Auto, Some(120.0)));
    assert_eq!(set.size.unwrap().pixels(), [8, 9]);
    assert_eq!(place(&asked.settings, "view.size").to_string(), "--size");

    // Commands that pictures and figures come from are as they are told, whatever somebody has set.
    let capture = cli::parse_within(["fathomless", "capture"], sources.around.clone()).unwrap();
    let Asked::Capture(args) = capture.action else { panic!("not a capture") };
    assert!(args.runtime == RuntimeChoice::Auto && !capture.validate);
}

#[test]
fn what_is_wrong_is_said_with_its_place_and_what_would_be_right() {
    let cases: &[(&str, &[&str])] = &[
        (
            "[motion]\n\nsped = 2\n",
            &["toml:3:1: ", "`motion.sped`", "[motion]", "scale_s", "did you mean `speed`?"],
        ),
        ("[motoin]\nspeed = 2\n", &["toml:1:2: ", "`motoin", "did you mean `motion`?"]),
        ("speed = 2\n", &["toml:1:1: ", "did you mean `motion.speed`?"]),
        (
            "[motion]\nspeed = 'fast'\n",
            &["toml:2:9: ", "`motion.speed` is 'fast'", "a number from 0.0625 to 8"],
        ),
        ("[motion]\nspeed = 9\n", &["toml:2:9: ", "is 9", "0.0625 to 8"]),
        ("[motion]\nspeed = nan\n", &["is nan", "0.0625 to 8"]),
        ("[motion]\nspeed = { x = 1 }\n", &["toml:2:9: ", "`motion.speed`", "0.0625 to 8"]),
        ("motion = 3\n", &["toml:1:1: ", "`motion`", "section", "speed"]),
        ("[view]\nruntime = 'mok'\n", &["\"auto\", \"system\" or \"mock\"", "did you mean `mock`?"]),
        ("[view]\nsize = '640'\n", &["`view.size`", "\"auto\" or \"WIDTHxHEIGHT\""]),
        ("[quality]\ncells = 33\n", &["\"auto\", 16, 32, 64 or 128"]),
        ("[quality]\nlevels_below = 2.5\n", &["a whole number from 0 to 5"]),
        ("[keys]\ndive = 'z'\n", &["`keys.dive` is 'z'", "did you mean `Z`?"]),
        ("[keys]\ndive = ['Z', 'Entr']\n", &["did you mean `Enter`?"]),
        ("[keys]\ndve = 'Z'\n", &["did you mean `dive`?"]),
        ("[gamepad.axes]\nahead = '--left_y'\n", &["`gamepad.axes.ahead`", "\"none\""]),
        ("[gamepad.buttons]\ndive = 'a'\n", &["`gamepad.buttons.dive`", "\"south\""]),
        ("[desk]\nscreenshots = ''\n", &["`desk.screenshots`", "text"]),
        ("[motion]\nspeed = 1\nspeed = 2\n", &["toml:3:", "duplicate key"]),
        ("[motion]\nspeed = \n", &["toml:2:"]),
        // A file whose end is missing.
        ("[keys]\ndive = ['Z', 'En", &["toml:2:"]),
        ("[motion", &["toml:1:"]),
        ("é = 1\n[motion]\nspeed = 'é'", &["toml:1:1: "]),
    ];
    for (text, words) in cases {
        let (_folder, sources) = home(text);
        refused(&sources, words);
    }
    // Columns count characters, as editors do.
    let (_folder, sources) = home("keys.'dive' = ['é', 'x']");
    refused(&sources, &["toml:1:15: "]);

    refused(&sets(&["motion.speed"]), &["--set motion.speed: ", "no `=`", "motion.speed=2"]);
    refused(&sets(&["motion.sped=2"]), &["--set motion.sped=2: ", "did you mean `speed`?"]);
    refused(&sets(&["motion.speed=2", "motion.speed=fast"]), &["--set motion.speed=fast: ", "0.0625 to 8"]);
    refused(
        &variables(&[("FATHOMLESS_MOTION_SPEED", "fast")]),
        &["FATHOMLESS_MOTION_SPEED: ", "0.0625 to 8"],
    );
}

#[test]
fn words_need_no_quotes_where_words_are_taken() {
    let loaded = sets(&[
        "view.runtime=mock",
        "keys.dive=Enter",
        "keys.end=[\"Q\"]",
        "desk.screenshots=12",
        "view.size=9x8",
    ])
    .load();
    let settings = loaded.unwrap().settings;
    assert_eq!(settings.view.runtime, RuntimeChoice::Mock);
    assert_eq!(settings.keys.names(Action::Dive).collect::<Vec<_>>(), ["Enter"]);
    assert_eq!(settings.keys.names(Action::End).collect::<Vec<_>>(), ["Q"]);
    assert_eq!(settings.desk.screenshots, "12");
    let loaded =
        variables(&[("FATHOMLESS_MIRROR_SIDE", "both"), ("FATHOMLESS_KEYS_ROLL_LEFT", "4")]).load().unwrap();
    assert_eq!(loaded.settings.mirror.side, Side::Both);
    assert_eq!(loaded.settings.keys.names(Action::RollLeft).collect::<Vec<_>>(), ["4"]);
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let (folder, sources) = home("");
    let file = folder.path().join("fathomless.toml");
    fs::write(&file, b"[motion]\nspeed = \xff\n").unwrap();
    refused(&sources, &["fathomless.toml", "cannot be read"]);
    fs::remove_file(&file).unwrap();
    sources.load().expect("a file that is not there is none");
    fs::create_dir(&file).unwrap();
    refused(&sources, &["fathomless.toml", "cannot be read"]);

    for path in [folder.path().join("none.toml"), folder.path().to_owned()] {
        let asked = Sources { config: Some(path), ..Sources::default() };
        refused(&asked, &["cannot be read", "--config"]);
    }
}

#[test]
fn other_variables_are_left_alone_and_misspelt_ones_remarked_upon() {
    let others: Vec<_> = VARIABLES_OF_OTHERS.iter().map(|name| (*name, "1")).chain([("HOME", "/")]).collect();
    assert_eq!(variables(&others).load().unwrap().remarks, [""; 0]);
    let loaded = variables(&[("FATHOMLESS_MOTION_SPED", "2")]).load().unwrap();
    assert!(loaded.remarks[0].contains("did you mean `FATHOMLESS_MOTION_SPEED`?"), "{:?}", loaded.remarks);
    let loaded = sets(&["keys.dive=X"]).load().unwrap();
    assert!(loaded.remarks[0].contains("key X") && loaded.remarks[0].contains("dive, back_out"));
    assert_eq!(Sources::default().load().unwrap().remarks, [""; 0], "what is built in is meant");

    // Every variable that the program, its scripts and its tests read is known here.
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut known: BTreeSet<String> = VARIABLES_OF_OTHERS.map(str::to_owned).into();
    known.extend(["FATHOMLESS_MOTION_SPEED", "FATHOMLESS_MOTION_SPED"].map(str::to_owned));
    let mut read = 0;
    let mut folders = vec![root.join("src")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let Ok(text) = fs::read_to_string(&path) else { continue };
            for rest in text.split("FATHOMLESS_").skip(1) {
                let name: String = rest.chars().take_while(|c| c.is_ascii_uppercase() || *c == '_').collect();
                let name = format!("FATHOMLESS_{name}");
                assert!(name.ends_with('_') || known.contains(&name), "{}: {name}", path.display());
                read += 1;
            }
        }
    }
    assert!(read > 10, "{read}");
}

#[test]
fn a_changed_file_is_noticed_and_so_is_a_wrong_one() {
    let (folder, sources) = home("[motion]\nspeed = 2\n");
    let file = folder.path().join("fathomless.toml");
    let watch = Watch::new(sources);
    let news = || {
        let deadline = Instant::now() + Duration::from_secs(120);
        loop {
            if let Some(news) = watch.news() {
                return news;
            }
            assert!(Instant::now() < deadline, "no news");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    fs::write(&file, "[motion]\nspeed = 3.5\n").unwrap();
    assert_eq!(news().unwrap().settings.motion.speed, 3.5);
    fs::write(&file, "[motion]\nspeed = 'fast'\n").unwrap();
    assert!(news().unwrap_err().to_string().contains("toml:2:9"));
    fs::remove_file(&file).unwrap();
    assert_eq!(news().unwrap().settings, Settings::default());
    save_to(&file, &[("motion.speed", 4.into())]).unwrap();
    assert_eq!(news().unwrap().settings.motion.speed, 4.0);
}

#[test]
fn what_has_changed_is_news_once_however_often_it_is_looked_at() {
    let (state, looks, reads) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicU32::new(0)), AtomicU32::new(0));
    let (seen, looked) = (Arc::clone(&state), Arc::clone(&looks));
    let look = move || {
        looked.fetch_add(1, Ordering::SeqCst);
        seen.load(Ordering::SeqCst)
    };
    let watch = watch::Watch::new(look, move || reads.fetch_add(1, Ordering::SeqCst) + 1);
    let looks_later = |more: u32| {
        let (until, deadline) =
            (looks.load(Ordering::SeqCst) + more, Instant::now() + Duration::from_secs(120));
        while looks.load(Ordering::SeqCst) < until {
            assert!(Instant::now() < deadline, "nobody looks");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    looks_later(2);
    assert_eq!(watch.news(), None, "what was there is known");
    for change in 1..=2 {
        state.store(change, Ordering::SeqCst);
        // A look that had begun, the one that finds it, and two more.
        looks_later(4);
        assert_eq!((watch.news(), watch.news()), (Some(change), None), "once");
    }
}

#[test]
fn saving_changes_what_is_asked_and_keeps_the_rest() {
    let text =
        "# mine\n[motion]\nspeed = 2.0   # quick\n# steady\nslide = 5\n\n[keys]\ndive = [\"Z\"] # down\n";
    let changed = edit(
        "f",
        text,
        &[
            ("motion.speed", 3.0.into()),
            ("motion.turn_rate", 45.into()),
            ("keys.dive", vec!["Enter", "Z"].into()),
            ("gamepad.axes.up", "right_y".into()),
            ("mirror.side", "both".into()),
        ],
    )
    .unwrap();
    let expected = "# mine\n[motion]\nspeed = 3.0   # quick\n# steady\nslide = 5\nturn_rate = 45\n\n[keys]\n\
                    dive = [\"Enter\", \"Z\"] # down\n\n[gamepad.axes]\nup = \"right_y\"\n\n[mirror]\nside = \"both\"\n";
    assert_eq!(changed, expected);
    assert_eq!(edit("f", text, &[]).unwrap(), text);
    // Dotted and inline tables are tables, too.
    let inline = edit(
        "f",
        "motion = { speed = 2 } # all\n",
        &[("motion.speed", 1.into()), ("motion.slide", 7.into())],
    );
    assert_eq!(inline.unwrap(), "motion = { speed = 1 , slide = 7 } # all\n");
    let dotted = edit("f", "motion.speed = 2 # so\n", &[("motion.speed", 1.into())]).unwrap();
    assert_eq!(dotted, "motion.speed = 1 # so\n");

    // Comments at the end stay where they are, also those of a file that has nothing else.
    let tail = edit("f", "[motion]\nspeed = 2\n# tail", &[("mouse.invert", true.into())]).unwrap();
    assert_eq!(tail, "[motion]\nspeed = 2\n# tail\n\n[mouse]\ninvert = true\n");
    let within = edit("f", "gamepad = { curve = 1 }\n", &[("gamepad.axes.up", "none".into())]).unwrap();
    assert!(within.starts_with("gamepad = { curve = 1") && within.contains("axes"), "{within}");
    let below = edit("f", "gamepad.curve = 1\n", &[("gamepad.axes.up", "none".into())]).unwrap();
    assert!(below.starts_with("gamepad.curve = 1\n") && below.contains("axes"), "{below}");

    for (change, word) in
        [(("motion.speed", Value::from(99)), "0.0625 to 8"), (("motion.sped", 1.into()), "`speed`")]
    {
        assert!(edit("f", text, &[change]).unwrap_err().to_string().contains(word));
    }
    assert!(edit("f", "[motion]\nspeed = 'x'\n", &[("motion.slide", 1.into())]).is_err(), "wrong already");
}

/// The whole manual survives any change of any setting.
#[test]
fn every_setting_can_be_saved_over_the_manual() {
    let built_in = Sources::default().load().unwrap();
    for line in &built_in.lines {
        let saved = edit("f", MANUAL, &[(&line.path, line.value.clone())]).unwrap();
        let comments = |text: &str| text.matches('#').count();
        assert_eq!(comments(&saved), comments(MANUAL), "{}", line.path);
        let (_folder, sources) = home(&saved);
        assert_eq!(sources.load().unwrap().settings, Settings::default(), "{}", line.path);
    }
}

#[test]
fn saving_is_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a/b/fathomless.toml");
    save_to(&file, &[("motion.speed", 2.into())]).unwrap();
    assert_eq!(fs::read_to_string(&file).unwrap(), "[motion]\nspeed = 2\n");
    assert!(save_to(&file, &[("motion.speed", 2.into()), ("motion.slide", 99.into())]).is_err());
    assert_eq!(fs::read_to_string(&file).unwrap(), "[motion]\nspeed = 2\n");
    fs::write(&file, "[motion\n").unwrap();
    assert!(save_to(&file, &[("motion.speed", 2.into())]).is_err());
    assert_eq!(fs::read_to_string(&file).unwrap(), "[motion\n", "a damaged file is left to its owner");
    assert_eq!(fs::read_dir(file.parent().unwrap()).unwrap().count(), 1, "nothing else is left behind");

    // Who keeps it elsewhere has a link here.
    let (elsewhere, link) = (folder.path().join("dots.toml"), folder.path().join("link.toml"));
    fs::write(&elsewhere, "# dots\n").unwrap();
    std::os::unix::fs::symlink(&elsewhere, &link).unwrap();
    save_to(&link, &[("mouse.invert", true.into())]).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read_to_string(&elsewhere).unwrap(), "# dots\n\n[mouse]\ninvert = true\n");
}

fn fathomless(home: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fathomless"));
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("FATHOMLESS_")) {
        command.env_remove(name);
    }
    command.args(args).env("XDG_CONFIG_HOME", home).env("HOME", home).output().unwrap()
}

#[test]
fn the_command_prints_what_is_in_force_as_a_file_that_says_the_same() {
    let home = tempfile::tempdir().unwrap();
    fs::create_dir(home.path().join("fathomless")).unwrap();
    let file = home.path().join("fathomless/fathomless.toml");
    fs::write(&file, "[motion]\nspeed = 2\n").unwrap();
    let said = fathomless(home.path(), &["settings", "--set", "keys.dive=Enter"]);
    let text = String::from_utf8(said.stdout).unwrap();
    assert_eq!(said.status.code(), Some(0), "{text}");
    for words in
        ["speed = 2", &format!("# {}:2:9", file.display()), "# --set keys.dive=Enter", "comfort_m = 2.0\n"]
    {
        assert!(text.contains(words), "{words:?} expected: {text}");
    }
    let again = Sources {
        sets: vec!["keys.dive=Enter".to_owned(), "motion.speed=2".to_owned()],
        ..Sources::default()
    };
    let (_folder, printed) = self::home(&text);
    assert_eq!(printed.load().unwrap().settings, again.load().unwrap().settings);

    let manual = fathomless(home.path(), &["settings", "--manual"]);
    assert_eq!(String::from_utf8(manual.stdout).unwrap(), MANUAL);

    // Help names the keys as they are.
    fs::write(&file, "[keys]\nback_out = ['Backspace', 'K']\n").unwrap();
    let help = String::from_utf8(fathomless(home.path(), &["view", "--help"]).stdout).unwrap();
    let row = help.lines().find(|line| line.contains("back out")).unwrap();
    assert!(row.contains("Backspace K") && row.contains("left_trigger"), "{row}");

    fs::write(&file, "[motion]\nspeed = 'fast'\n").unwrap();
    for args in [&["settings"][..], &["view"], &[]] {
        let said = fathomless(home.path(), args);
        let sentence = String::from_utf8(said.stderr).unwrap();
        assert_eq!(said.status.code(), Some(2), "{args:?}: {sentence}");
        assert!(sentence.contains("fathomless.toml:2:9: ") && sentence.lines().count() == 1, "{sentence}");
    }
    assert_eq!(fathomless(home.path(), &["worlds"]).status.code(), Some(0), "which needs no settings");
    assert_eq!(fathomless(home.path(), &["view", "--help"]).status.code(), Some(0));
    assert!(matches!(
        cli::parse_from(["fathomless", "settings", "--manual", "--set", "a=b"]),
        Err(Stop::Usage(_))
    ));
}

/// README's table of keys is the built-in one: each action's keys stand in a row that says what they do.
#[test]
fn the_readme_tells_the_keys_as_they_are() {
    let readme = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let table = readme.split("| keys |").nth(1).expect("a table of keys").split("\n\n").next().unwrap();
    let rows: Vec<(BTreeSet<&str>, &str)> = table
        .lines()
        .filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | "))
        .map(|(keys, does)| (keys.split([' ', ',']).filter(|key| !key.is_empty()).collect(), does))
        .collect();
    let mut told: BTreeSet<&str> = rows.iter().flat_map(|(keys, _)| keys.iter().copied()).collect();
    let settings = Settings::default();
    for binding in settings.bindings() {
        let word = match binding.action {
            Action::RollLeft | Action::RollRight => "roll",
            Action::Faster | Action::Slower => "faster, slower",
            Action::NextEye => "left eye, right eye, both",
            Action::TakeMouse => "take the mouse",
            action => action
                .does()
                .trim_start_matches("held: ")
                .trim_start_matches("fly ")
                .split(" as ")
                .next()
                .unwrap(),
        };
        for key in settings.keys.names(binding.action) {
            let row = rows.iter().find(|(keys, does)| {
                keys.contains(key) && does.contains(word.split([',', ';', ':']).next().unwrap())
            });
            assert!(row.is_some(), "README: {key} should be told, with {word:?}: {rows:?}");
            told.remove(key);
        }
    }
    assert_eq!(told, BTreeSet::from(["wheel", "double-click"]), "README tells of keys that do nothing");
}
