//! Files that are looked at now and then, by a thread of their own.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, SystemTime};

/// From one look to the next.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// What tells that a file has changed: when that was, and how long it is. None: it cannot be seen.
pub type Stamp = Option<(SystemTime, u64)>;

/// The stamp of a file, or of a folder.
pub fn stamp(path: &Path) -> Stamp {
    let about = std::fs::metadata(path).ok()?;
    Some((about.modified().ok()?, about.len()))
}

/// News of files. Asking for them touches no file and never waits.
pub struct Watch<T> {
    news: Receiver<T>,
    /// The thread ends when this goes.
    _life: Sender<()>,
}

impl<T: Send + 'static> Watch<T> {
    /// Whenever what `look` returns is another than before, what `read` returns then is news. What is there now is known
    /// already.
    pub fn new<S: PartialEq + Send + 'static>(
        look: impl Fn() -> S + Send + 'static,
        read: impl Fn() -> T + Send + 'static,
    ) -> Watch<T> {
        let (says, news) = channel();
        let (life, ends) = channel::<()>();
        let mut seen = look();
        std::thread::spawn(move || {
            while ends.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
                let now = look();
                if now != seen {
                    seen = now;
                    if says.send(read()).is_err() {
                        return;
                    }
                }
            }
        });
        Watch { news, _life: life }
    }

    /// The last news since it was last asked.
    pub fn news(&self) -> Option<T> {
        self.news.try_iter().last()
    }
}
