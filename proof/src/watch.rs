//! Names the item of a search that does not end.
//!
//! Items of a search are looked at to their end, and one without an end would leave people with a search that stands still. A [`Watch`] has a thread that counts ticks and
//! says which item has seen too many of them. Ticks are sleeps, not times of a clock: on a machine that stands still nothing is late.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Items that run, by the order in which they began: the seed and the ticks that it saw.
#[derive(Debug, Default)]
struct Running {
    begun: u64,
    items: BTreeMap<u64, (u64, u64)>,
    has_ended: bool,
}

#[derive(Debug, Default)]
struct Shared {
    running: Mutex<Running>,
    ended: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Running> {
        // A panic of the caller's work does not happen under the lock.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Watches over items until it is dropped.
#[derive(Debug)]
pub struct Watch {
    shared: Arc<Shared>,
}

impl Watch {
    /// Tells `late` the seed of each item that has run for `ticks` ticks of a length, once for each item. Without a thread to spare nothing is watched.
    #[must_use]
    pub fn new(ticks: u64, tick: Duration, late: impl Fn(u64) + Send + 'static) -> Watch {
        let shared = Arc::new(Shared::default());
        let own = shared.clone();
        let watch = move || {
            let mut running = own.lock();
            while !running.has_ended {
                running = own.ended.wait_timeout(running, tick).unwrap_or_else(PoisonError::into_inner).0;
                let mut seeds = Vec::new();
                for (seed, seen) in running.items.values_mut() {
                    *seen += 1;
                    seeds.extend((*seen == ticks).then_some(*seed));
                }
                drop(running);
                seeds.into_iter().for_each(&late);
                running = own.lock();
            }
        };
        // Detached: it ends one tick after the watch at the latest.
        drop(thread::Builder::new().name("watch".into()).spawn(watch));
        Watch { shared }
    }

    /// Does the work of an item.
    pub fn over<T>(&self, seed: u64, work: impl FnOnce() -> T) -> T {
        let mut running = self.shared.lock();
        let item = Item { shared: &self.shared, number: running.begun };
        running.begun += 1;
        running.items.insert(item.number, (seed, 0));
        drop(running);
        work()
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.shared.lock().has_ended = true;
        self.shared.ended.notify_all();
    }
}

/// An item that runs; it is over when this is dropped, in a panic as well.
struct Item<'w> {
    shared: &'w Shared,
    number: u64,
}

impl Drop for Item<'_> {
    fn drop(&mut self) {
        self.shared.lock().items.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn an_item_that_does_not_end_is_named_once_and_no_other() {
        let (send, receive) = channel();
        let watch = Watch::new(20, Duration::from_millis(1), move |seed| _ = send.send(seed));
        watch.over(3, || ());
        let panicked = crate::panics::caught(|| watch.over(4, || panic!("an item that panics")));
        assert!(panicked.is_err());
        // It ends when it has been named, and not before.
        let named = watch.over(5, || {
            watch.over(6, || ());
            receive.recv_timeout(Duration::from_secs(60))
        });
        assert_eq!(named, Ok(5));
        assert!(watch.shared.lock().items.is_empty());
        drop(watch);
        assert_eq!(
            receive.recv_timeout(Duration::from_secs(60)).ok(),
            None,
            "nothing else was late, and the thread has ended"
        );
    }
}
