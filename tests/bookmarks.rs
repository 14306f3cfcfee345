//! Bookmarks: kept whole, whoever writes at once, and nothing is lost of a damaged file.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use fathomless::address::Address;
use fathomless::at;
use fathomless::bookmarks::{Error, FOLDER_VARIABLE, Name, Store};
use fathomless::world::World;

fn address(depth: usize) -> Address {
    let world = World::load("hills").unwrap();
    Address::of(&world, &at::stand(&world, depth, None).standpoint())
}

fn name(text: &str) -> Name {
    text.parse().unwrap()
}

fn fathomless(folder: &Path, args: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_fathomless");
    Command::new(program).args(args).env(FOLDER_VARIABLE, folder).env_remove("RUST_LOG").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn names(store: &Store) -> Vec<String> {
    store.list().unwrap().bookmarks.into_keys().collect()
}

#[test]
fn a_bookmark_is_added_found_and_removed() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("made/where/missing");
    let (first, second) = (address(0).to_string(), address(9).to_string());
    let empty = fathomless(&inside, &["bookmarks"]);
    assert!(text(&empty.stdout).contains("bookmarks add NAME --at PLACE"), "{empty:?}");
    assert!(!inside.exists(), "looking makes nothing");

    for (name, address) in [("mesa", &first), ("canyon-2", &second)] {
        let added = fathomless(&inside, &["bookmarks", "add", name, "--at", address]);
        assert!(added.status.success() && added.stderr.is_empty(), "{added:?}");
    }
    let list = text(&fathomless(&inside, &["bookmarks", "list"]).stdout);
    assert_eq!(list, format!("canyon-2  {second}\nmesa  {first}\n"));
    assert_eq!(list, text(&fathomless(&inside, &["bookmarks"]).stdout));

    // There, by name: the same place and the same text.
    let there = fathomless(&inside, &["export", "--at", "@canyon-2", "--cells", "1"]);
    assert!(text(&there.stdout).contains(&format!("address: {second}\n")), "{there:?}");

    let taken = fathomless(&inside, &["bookmarks", "add", "mesa", "--at", &second]);
    assert_eq!(taken.status.code(), Some(1));
    assert!(text(&taken.stderr).contains("`mesa` already"), "{taken:?}");
    let unknown = fathomless(&inside, &["view", "--at", "@mese"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        text(&unknown.stderr).contains("no bookmark is called `mese`; there are canyon-2, mesa"),
        "{unknown:?}"
    );

    assert!(fathomless(&inside, &["bookmarks", "remove", "mesa"]).status.success());
    let gone = fathomless(&inside, &["bookmarks", "remove", "mesa"]);
    assert!(text(&gone.stderr).contains("no bookmark is called `mesa`; there are canyon-2"), "{gone:?}");
    assert_eq!(names(&Store::at(&inside)), ["canyon-2"]);
    assert_eq!(Store::at(&inside).find("canyon-2").unwrap(), second);
}

#[test]
fn names_are_simple() {
    for good in ["mesa", "Ä-1", "2", "a.b_c-d", &"x".repeat(64), "山"] {
        assert_eq!(name(good).as_str(), good);
    }
    for bad in ["", " ", "a b", "-x", ".x", "a/b", "a\nb", "@a", "a=b", "\"", &"x".repeat(65)] {
        let sentence = bad.parse::<Name>().expect_err(bad);
        assert!(sentence.contains("1 to 64 letters"), "{sentence}");
    }
}

#[test]
fn instances_writing_at_once_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let address = address(1);
    std::thread::scope(|scope| {
        for who in ["a", "b"] {
            let (folder, address) = (folder.path(), &address);
            scope.spawn(move || {
                // A store of its own each, as two processes have.
                let store = Store::at(folder);
                for i in 0..50 {
                    assert_eq!(store.add(&name(&format!("{who}{i}")), address).unwrap(), None);
                }
            });
        }
        for who in ["p", "q"] {
            let (folder, address) = (folder.path(), address.to_string());
            scope.spawn(move || {
                for i in 0..50 {
                    let added =
                        fathomless(folder, &["bookmarks", "add", &format!("{who}{i}"), "--at", &address]);
                    assert!(added.status.success(), "{added:?}");
                }
            });
        }
        // Whoever reads meanwhile sees a whole file.
        let store = Store::at(folder.path());
        let mut before = 0;
        for _ in 0..200 {
            let listing = store.list().unwrap();
            assert_eq!(listing.damage, None);
            assert!(listing.bookmarks.len() >= before);
            before = listing.bookmarks.len();
        }
    });
    assert_eq!(names(&Store::at(folder.path())).len(), 200);
    let mut files: Vec<String> =
        fs::read_dir(&folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    assert_eq!(files, ["bookmarks.lock", "bookmarks.toml"]);
}

#[test]
fn a_damaged_file_is_kept_aside() {
    let address = address(2);
    let good = format!("[bookmarks]\nmesa = \"{address}\"\nrim = \"{address}\"\n");
    let cases = [
        ("cut short", good.as_bytes()[..good.len() - 20].to_vec(), vec!["mesa"]),
        ("empty", Vec::new(), vec![]),
        ("given twice", format!("{good}rim = \"fathomless:other\"\n").into_bytes(), vec!["mesa", "rim"]),
        ("another key", format!("colour = 3\n{good}").into_bytes(), vec!["mesa", "rim"]),
        ("a number", format!("{good}deep = 7\n").into_bytes(), vec!["mesa", "rim"]),
        ("no text", [good.as_bytes(), b"x = \"\xff\xfe\0\n"].concat(), vec!["mesa", "rim"]),
        ("a conflict", format!("<<<<<<< here\n{good}>>>>>>> there\n").into_bytes(), vec!["mesa", "rim"]),
    ];
    for (what, bytes, rescued) in cases {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::at(folder.path());
        fs::write(store.path(), &bytes).unwrap();

        // Looking says so, gives what can be read, and changes nothing.
        let listing = store.list().unwrap();
        let damage = listing.damage.expect(what);
        assert_eq!((damage.rescued, damage.aside), (rescued.len(), false), "{what}");
        assert_eq!(listing.bookmarks.into_keys().collect::<Vec<_>>(), rescued, "{what}");
        let looked = fathomless(folder.path(), &["bookmarks"]);
        assert!(looked.status.success() && text(&looked.stderr).contains("damaged"), "{looked:?}");
        assert_eq!(fs::read(store.path()).unwrap(), bytes, "{what}");

        // So does a change that fails.
        assert!(matches!(store.remove("nobody"), Err(Error::Missing { .. })));
        assert_eq!(fs::read(store.path()).unwrap(), bytes, "{what}");

        // A change keeps the file aside, and says where.
        let added = fathomless(folder.path(), &["bookmarks", "add", "zz", "--at", &address.to_string()]);
        let said = text(&added.stderr);
        assert!(added.status.success() && said.contains("bookmarks.toml.bad-1"), "{what}: {said}");
        assert_eq!(fs::read(folder.path().join("bookmarks.toml.bad-1")).unwrap(), bytes, "{what}");
        let listing = store.list().unwrap();
        assert_eq!(listing.damage, None);
        assert_eq!(
            listing.bookmarks.into_keys().collect::<Vec<_>>(),
            [&rescued[..], &["zz"]].concat(),
            "{what}"
        );

        // The next one too, beside it.
        fs::write(store.path(), "[[").unwrap();
        let damage = store.add(&name("again"), &address).unwrap().unwrap();
        assert_eq!((damage.path, damage.aside), (folder.path().join("bookmarks.toml.bad-2"), true));
        assert_eq!(fs::read(folder.path().join("bookmarks.toml.bad-1")).unwrap(), bytes, "{what}");
    }
}

#[test]
fn what_somebody_wrote_by_hand_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::at(folder.path());
    // Names that we would not make, and addresses of another version.
    fs::write(store.path(), "[bookmarks]\n\"my place\" = \"fathomless:9:later:00000000\"\n").unwrap();
    store.add(&name("mesa"), &address(0)).unwrap();
    assert_eq!(names(&store), ["mesa", "my place"]);
    let later = fathomless(folder.path(), &["view", "--at", "@my place"]);
    assert_eq!(later.status.code(), Some(2));
    assert!(text(&later.stderr).contains("@my place: this address"), "{later:?}");
}

#[test]
fn a_folder_that_cannot_be_written_is_told_and_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let address = address(0);
    // A file where the folder should be, and a folder that nobody can make.
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    for place in [file.join("below"), Path::new("/proc/fathomless").to_owned()] {
        let added = fathomless(&place, &["bookmarks", "add", "x", "--at", &address.to_string()]);
        let sentence = text(&added.stderr);
        assert_eq!(added.status.code(), Some(1));
        assert!(
            sentence.contains("cannot write bookmarks to") && sentence.contains(FOLDER_VARIABLE),
            "{sentence}"
        );
        assert_eq!(sentence.matches('\n').count(), 1, "{sentence}");
    }

    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let store = Store::at(folder.path().join("mine"));
        store.add(&name("mesa"), &address).unwrap();
        let before = fs::read(store.path()).unwrap();
        let set =
            |mode| fs::set_permissions(folder.path().join("mine"), fs::Permissions::from_mode(mode)).unwrap();
        set(0o555);
        // Root may write all the same.
        let is_root = fs::write(folder.path().join("mine/probe"), "").is_ok();
        let added = store.add(&name("rim"), &address);
        if !is_root {
            assert!(matches!(added, Err(Error::Unwritable { .. })), "{added:?}");
            assert_eq!(fs::read(store.path()).unwrap(), before);
        }
        assert!(names(&store).contains(&"mesa".to_owned()));
        set(0o755);
    }
}

#[test]
fn an_unreadable_file_is_told() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("bookmarks.toml")).unwrap();
    let listed = fathomless(folder.path(), &["bookmarks"]);
    assert_eq!(listed.status.code(), Some(1));
    assert!(text(&listed.stderr).contains("cannot read the bookmarks in"), "{listed:?}");
    let added = fathomless(folder.path(), &["bookmarks", "add", "x", "--at", &address(0).to_string()]);
    assert_eq!(added.status.code(), Some(1));
}
