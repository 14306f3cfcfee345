//! A file is written whole or not at all, by however many at once.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::io::{self, Write};

use fathomless::files;

#[test]
fn a_file_that_many_write_at_once_is_whole_and_leaves_nothing_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    std::thread::scope(|scope| {
        for writer in 0..8u8 {
            let path = &path;
            scope.spawn(move || {
                for _ in 0..50 {
                    files::write_whole(path, |file| file.write_all(&[writer; 10_000])).unwrap();
                    let read = fs::read(path).unwrap();
                    assert_eq!(read.len(), 10_000);
                    assert!(read.iter().all(|byte| *byte == read[0]), "two writers' bytes in one file");
                }
            });
        }
    });
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn what_fails_leaves_the_old_file_and_nothing_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    files::write_whole(&path, |file| file.write_all(b"old")).unwrap();
    let failed = files::write_whole(&path, |file| {
        file.write_all(b"half of the ne")?;
        Err(io::Error::other("the disk is full"))
    });
    assert!(failed.is_err());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}
