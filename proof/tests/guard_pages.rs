//! Programs that verify stay inside their image: they run between pages that nobody may touch. `examples/guard_pages.rs` runs more.

#[path = "common/guarded.rs"]
mod guarded;
#[path = "common/guarded_search.rs"]
mod guarded_search;

use guarded::{Guarded, Side};
use khz_machine::image::{Image, ImageLayout};
use khz_proof::bytecode::generate;
use khz_proof::campaign::Campaign;
use khz_proof::statistics::Statistics;

#[global_allocator]
static ALLOCATOR: Guarded = Guarded;

/// Seeds; each is a program and a mutant.
const SEEDS: u64 = 150;

#[test]
fn programs_and_mutants_stay_inside_their_image() {
    let campaign = Campaign { first: 700_000, count: SEEDS, threads: 2, most_findings: 1 };
    let before = Guarded::blocks_ever();
    let report = campaign.run(guarded_search::look, |_| ()).expect("a thread");
    assert_eq!(report.findings, []);
    let Statistics { programs, runs, .. } = report.figures;
    assert!(programs * 10 >= SEEDS * 15, "{programs} programs: most seeds have a mutant that verifies");
    assert!(runs >= programs * 90, "{runs} runs of {programs} programs");
    // At least an image for the evaluator and for each form of each engine.
    assert!(Guarded::blocks_ever() - before >= programs * 5, "images lie between guard pages");
}

/// What becomes of a child process that reads a byte of an image, or near it.
fn reads(side: Side, at: impl Fn(&Image) -> isize) -> libc::c_int {
    let verified = generate(1);
    let layout = ImageLayout::new(verified.container(), 1 << 20).expect("a small image");
    let image = Guarded::run(side, || Image::new(layout, verified.container()));
    let place = image.bytes().as_ptr().wrapping_offset(at(&image));
    // SAFETY: the child does nothing but read a byte and end, without anything that other threads might hold.
    let child = unsafe { libc::fork() };
    if child == 0 {
        // SAFETY: inside the image this is a byte of it; outside, the page without rights ends this process, which is what is wanted.
        std::hint::black_box(unsafe { place.read_volatile() });
        // SAFETY: ends the child at once.
        unsafe { libc::_exit(0) };
    }
    let mut status = 0;
    // SAFETY: waits for the child that was made above.
    assert_eq!(unsafe { libc::waitpid(child, &raw mut status, 0) }, child);
    status
}

#[test]
fn a_byte_outside_ends_the_process() {
    let last = |image: &Image| image.bytes().len() as isize - 1;
    for side in [Side::Before, Side::Behind] {
        for inside in [reads(side, |_| 0), reads(side, last)] {
            assert!(
                libc::WIFEXITED(inside) && libc::WEXITSTATUS(inside) == 0,
                "{side:?}: the image itself is readable"
            );
        }
    }
    let outside = [reads(Side::Before, |_| -1), reads(Side::Behind, move |image| last(image) + 65)];
    for status in outside {
        assert!(libc::WIFSIGNALED(status) && libc::WTERMSIG(status) == libc::SIGSEGV, "status {status}");
    }
}
