//! The host: real-time priority, processor, locked memory, timer slack, signals. The one file of this crate with `unsafe`.
//!
//! Nothing here pretends: each thing asked for is reported with what became of it.

use std::fmt;
use std::io;
use std::num::NonZeroU64;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::getpid;
use rustix::thread::{CpuSet, gettid, sched_getaffinity, sched_setaffinity, set_current_timer_slack};

use crate::stop::StopHandle;

/// Stack of the scan thread unless another is asked for, in bytes. Locked memory includes it.
pub const SCAN_STACK_BYTES: usize = 16 << 20;
/// Time slice that an ordinary monitor thread asks for: a short one lets it preempt a busy scan thread on the same processor (Linux 6.12 and later).
const MONITOR_SLICE_NS: u64 = 100_000;

/// What to set up for the scan thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostOptions {
    /// SCHED_FIFO priority, 1 to 98; the monitor takes the next one. Memory is locked with it.
    pub real_time_priority: Option<u8>,
    /// Processor to stay on.
    pub cpu: Option<usize>,
    /// Stack of the scan thread in bytes.
    pub stack_bytes: usize,
}

impl Default for HostOptions {
    fn default() -> Self {
        HostOptions { real_time_priority: None, cpu: None, stack_bytes: SCAN_STACK_BYTES }
    }
}

/// One thing a host may give or refuse.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostFeature {
    /// SCHED_FIFO with this priority.
    RealTimePriority(u8),
    /// Staying on this processor.
    Cpu(usize),
    /// All memory, present and future, locked.
    LockedMemory,
    /// Timers without slack (for threads that are not real-time).
    TimerSlack,
}

impl fmt::Display for HostFeature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            HostFeature::RealTimePriority(priority) => write!(f, "real-time priority {priority} (SCHED_FIFO)"),
            HostFeature::Cpu(cpu) => write!(f, "processor {cpu}"),
            HostFeature::LockedMemory => write!(f, "locked memory"),
            HostFeature::TimerSlack => write!(f, "timers without slack"),
        }
    }
}

/// Why the host refused a feature.
#[derive(Debug, thiserror::Error)]
#[error("the host refused {feature}: {reason}")]
pub struct HostRefusal {
    /// What was refused.
    pub feature: HostFeature,
    /// Whether the user asked for it; the rest is tried as a matter of course.
    pub asked: bool,
    /// Why.
    pub reason: io::Error,
}

/// What became of everything that was tried.
#[derive(Debug, Default)]
pub struct HostReport {
    /// Given.
    pub granted: Vec<HostFeature>,
    /// Not given.
    pub refused: Vec<HostRefusal>,
}

impl HostReport {
    /// The first thing that the user asked for and did not get (exit status 4).
    #[must_use]
    pub fn first_refusal(&self) -> Option<&HostRefusal> {
        self.refused.iter().find(|refusal| refusal.asked)
    }

    fn note(&mut self, feature: HostFeature, asked: bool, outcome: io::Result<()>) {
        match outcome {
            Ok(()) => self.granted.push(feature),
            Err(reason) => self.refused.push(HostRefusal { feature, asked, reason }),
        }
    }
}

/// Sets the calling thread up for scanning.
fn prepare_scan_thread(options: &HostOptions) -> HostReport {
    let mut report = HostReport::default();
    report.note(HostFeature::TimerSlack, false, no_timer_slack());
    if let Some(cpu) = options.cpu {
        report.note(HostFeature::Cpu(cpu), true, stay_on(cpu));
    }
    if let Some(priority) = options.real_time_priority {
        let locked = mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE);
        report.note(HostFeature::LockedMemory, true, locked.map_err(io::Error::from));
        report.note(HostFeature::RealTimePriority(priority), true, set_fifo(priority));
    }
    report
}

/// Sets the calling thread up as monitor, as well as the host lets it: what is refused here only costs precision.
pub(crate) fn prepare_monitor_thread(scan_priority: Option<u8>) {
    let _ = no_timer_slack();
    // A thread inherits its maker's processor. The process's first thread is not pinned, so its set is what we may use.
    if let Ok(all) = sched_getaffinity(Some(getpid())) {
        let _ = sched_setaffinity(None, &all);
    }
    let priority = scan_priority.map_or(1, |priority| priority.saturating_add(1).min(99));
    if set_fifo(priority).is_err() {
        let _ = ask_for_short_slice();
    }
}

/// Runs `body` on a thread that is set up as `options` say, and waits for it. A panic in it goes on here.
///
/// Load, start and run belong into `body`: the image is then allocated, and the monitor thread made, where memory is already locked.
///
/// # Errors
/// When the host gives no thread.
pub fn on_scan_thread<T: Send>(options: &HostOptions, body: impl FnOnce(HostReport) -> T + Send) -> io::Result<T> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new()
            .name("khz-scan".to_owned())
            .stack_size(options.stack_bytes)
            .spawn_scoped(scope, || body(prepare_scan_thread(options)))?;
        thread.join().or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Makes SIGINT and SIGTERM request a stop.
///
/// # Errors
/// When the host does not take the handlers.
pub fn stop_on_signals(stop: &StopHandle) -> io::Result<()> {
    for signal in [libc::SIGINT, libc::SIGTERM] {
        let stop = stop.clone();
        // SAFETY: the handler does nothing but what a signal handler may: atomic operations and one futex system call. It does not panic.
        unsafe { signal_hook::low_level::register(signal, move || stop.request()) }?;
    }
    Ok(())
}

fn no_timer_slack() -> io::Result<()> {
    set_current_timer_slack(NonZeroU64::new(1)).map_err(io::Error::from)
}

fn stay_on(cpu: usize) -> io::Result<()> {
    if cpu >= CpuSet::MAX_CPU {
        return Err(io::Error::from_raw_os_error(libc::EINVAL));
    }
    let mut set = CpuSet::new();
    set.set(cpu);
    sched_setaffinity(None, &set).map_err(io::Error::from)
}

fn set_fifo(priority: u8) -> io::Result<()> {
    set_policy(0, libc::SCHED_FIFO, i32::from(priority))
}

/// Sets policy and priority of a thread of this process; 0 names the calling one.
fn set_policy(thread: i32, policy: i32, priority: i32) -> io::Result<()> {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: `parameters` is a valid sched_param that outlives the call.
    let status = unsafe { libc::sched_setscheduler(thread, policy, &raw const parameters) };
    if status == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// A scan thread whose deadline has passed: it must run to notice, also where other processes want its processor.
///
/// An ordinary thread is lifted to the least real-time priority if the host allows it, and lowered again by itself when its run has ended. The lock is
/// taken at a run's begin and end, and by the monitor after a deadline, never in a scan.
#[derive(Debug, Default)]
pub(crate) struct Lift(Mutex<Option<Lifted>>);

#[derive(Debug)]
struct Lifted {
    thread: i32,
    done: bool,
}

impl Lift {
    /// The calling thread is the one to lift, until [`Lift::end`].
    pub(crate) fn begin(&self) {
        let thread = gettid().as_raw_nonzero().get();
        *self.lock() = Some(Lifted { thread, done: false });
    }

    /// Lifts it, once.
    pub(crate) fn lift(&self) {
        if let Some(lifted) = self.lock().as_mut().filter(|lifted| !lifted.done) {
            // SAFETY: takes a number and touches no memory of ours.
            let policy = unsafe { libc::sched_getscheduler(lifted.thread) };
            // Refused is no harm: the thread notices when its turn comes.
            lifted.done = policy == libc::SCHED_OTHER && set_policy(lifted.thread, libc::SCHED_FIFO, 1).is_ok();
        }
    }

    /// Lowers the calling thread again, if it was lifted.
    pub(crate) fn end(&self) {
        if self.lock().take().is_some_and(|lifted| lifted.done) {
            // What could be raised can be lowered.
            let _ = set_policy(0, libc::SCHED_OTHER, 0);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Option<Lifted>> {
        // The value is whole at every step, so a panic elsewhere while it was locked does not matter.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn ask_for_short_slice() -> io::Result<()> {
    let attributes = libc::sched_attr {
        size: size_of::<libc::sched_attr>() as u32,
        sched_policy: libc::SCHED_OTHER as u32,
        sched_flags: 0,
        sched_nice: 0,
        sched_priority: 0,
        sched_runtime: MONITOR_SLICE_NS,
        sched_deadline: 0,
        sched_period: 0,
    };
    // SAFETY: `attributes` is a valid sched_attr of the size it states and outlives the call; 0 names the calling thread.
    let status = unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0) };
    if status == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_not_be_had_is_said() {
        let options = HostOptions { cpu: Some(usize::MAX), ..HostOptions::default() };
        let report = on_scan_thread(&options, |report| report).unwrap();
        let refusal = report.first_refusal().unwrap();
        assert_eq!(refusal.feature, HostFeature::Cpu(usize::MAX));
        assert!(refusal.to_string().contains("processor 18446744073709551615"), "{refusal}");
        assert!(!report.granted.contains(&HostFeature::Cpu(usize::MAX)));
    }

    #[test]
    fn a_granted_processor_is_the_one_it_runs_on() {
        let allowed = sched_getaffinity(None).unwrap();
        let cpu = (0..CpuSet::MAX_CPU).find(|cpu| allowed.is_set(*cpu)).unwrap();
        let options = HostOptions { cpu: Some(cpu), ..HostOptions::default() };
        let (report, used) = on_scan_thread(&options, |report| (report, rustix::thread::sched_getcpu())).unwrap();
        assert!(report.first_refusal().is_none(), "{report:?}");
        assert_eq!(used, cpu);
    }

    #[test]
    fn a_lifted_thread_comes_down_again() {
        let policy = || {
            // SAFETY: takes a number and touches no memory of ours.
            unsafe { libc::sched_getscheduler(0) }
        };
        std::thread::spawn(move || {
            let lift = Lift::default();
            lift.lift();
            assert_eq!(policy(), libc::SCHED_OTHER, "nobody to lift");
            lift.begin();
            lift.lift();
            lift.lift();
            lift.end();
            assert_eq!(policy(), libc::SCHED_OTHER);
            lift.lift();
            assert_eq!(policy(), libc::SCHED_OTHER, "the run has ended");
        })
        .join()
        .unwrap();
    }

    #[test]
    fn signals_request_a_stop() {
        let stop = StopHandle::new();
        stop_on_signals(&stop).unwrap();
        signal_hook::low_level::raise(libc::SIGTERM).unwrap();
        assert_eq!(stop.requests(), 1);
        signal_hook::low_level::raise(libc::SIGINT).unwrap();
        assert_eq!(stop.requests(), 2);
    }
}
