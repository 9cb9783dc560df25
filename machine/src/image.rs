//! The memory image of a resource (architecture §5): one allocation, made at load, never grown.
//!
//! `[ slots | data region | frame bytes of each task | %M | %Q staging | %I snapshot ]`; every region starts on a cache line.
//! All addresses are byte offsets from the image's start; a reference that a program stores is relative to the data region's start.

use std::ops::Range;

use khz_bytecode::container::{Container, Region};
use khz_bytecode::limits::{REGION_ALIGN_BYTES, SLOT_BYTES};
use khz_bytecode::value::BytePlace;

/// Where the regions of an image lie, in bytes from its start.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageLayout {
    /// Slots, 8 bytes each.
    pub slots: Range<u32>,
    /// Data region.
    pub data: Range<u32>,
    /// Frame bytes, one range for each task (at least one).
    pub frames: Vec<Range<u32>>,
    /// %M.
    pub memory: Range<u32>,
    /// %Q staging.
    pub output: Range<u32>,
    /// %I snapshot.
    pub input: Range<u32>,
}

/// An image larger than it may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the program needs a memory image of {needed_bytes} bytes; {limit_bytes} are allowed (--max-image)")]
pub struct ImageTooLarge {
    /// What it needs.
    pub needed_bytes: u64,
    /// What it may have.
    pub limit_bytes: u64,
}

impl ImageLayout {
    /// The layout of a container's image.
    ///
    /// # Errors
    /// When the image would be larger than `limit_bytes`, or than 2 GiB (offsets are 32 bits wide and native code adds them to signed displacements).
    pub fn new(container: &Container, limit_bytes: u64) -> Result<Self, ImageTooLarge> {
        let parameters = &container.parameters;
        let task_count = container.tasks.tasks.len().max(1);
        let mut end: u64 = 0;
        let mut region = |bytes: u64| {
            let start = end.next_multiple_of(u64::from(REGION_ALIGN_BYTES));
            end = start.saturating_add(bytes);
            start..end
        };
        let slots = region(container.types.slots.len() as u64 * u64::from(SLOT_BYTES));
        let data = region(u64::from(parameters.data_region_bytes));
        let frames: Vec<_> = (0..task_count).map(|_| region(u64::from(parameters.frame_bytes))).collect();
        let memory = region(u64::from(parameters.memory_image_bytes));
        let output = region(u64::from(parameters.output_image_bytes));
        let input = region(u64::from(parameters.input_image_bytes));
        let limit_bytes = limit_bytes.min(i32::MAX as u64);
        if end > limit_bytes {
            return Err(ImageTooLarge { needed_bytes: end, limit_bytes });
        }
        // Every offset is below `limit_bytes`, which fits 31 bits.
        let narrow = |range: Range<u64>| range.start as u32..range.end as u32;
        Ok(ImageLayout {
            slots: narrow(slots),
            data: narrow(data),
            frames: frames.into_iter().map(narrow).collect(),
            memory: narrow(memory),
            output: narrow(output),
            input: narrow(input),
        })
    }

    /// Bytes of the whole image.
    #[must_use]
    pub fn total_bytes(&self) -> u32 {
        self.input.end
    }

    /// Start of a place whose start does not depend on the call: `Data`, `Memory`, `Output`, `Input`.
    #[must_use]
    pub fn fixed_start(&self, place: BytePlace) -> Option<u32> {
        match place {
            BytePlace::Data => Some(self.data.start),
            BytePlace::Memory => Some(self.memory.start),
            BytePlace::Output => Some(self.output.start),
            BytePlace::Input => Some(self.input.start),
            BytePlace::Block | BytePlace::This | BytePlace::Frame => None,
        }
    }

    /// What a reference made from an integer may read: the data region up to the end of %I, as image offsets.
    #[must_use]
    pub fn readable(&self) -> Range<u32> {
        self.data.start..self.input.end
    }

    /// What a reference made from an integer may write: the data region up to the end of %Q.
    #[must_use]
    pub fn writable(&self) -> Range<u32> {
        self.data.start..self.output.end
    }

    /// The range of a region that has initial or retained values.
    #[must_use]
    pub fn region(&self, region: Region) -> Range<u32> {
        match region {
            Region::Slots => self.slots.clone(),
            Region::Data => self.data.clone(),
            Region::Memory => self.memory.clone(),
            Region::Output => self.output.clone(),
        }
    }
}

/// The memory of one resource.
///
/// The bytes start on a cache line. Safe code reaches them through bounds-checked slices; native code gets the start as a pointer.
#[derive(Debug)]
pub struct Image {
    layout: ImageLayout,
    storage: Vec<u8>,
    start: usize,
}

impl Image {
    /// A zeroed image, with the container's initial values in it.
    #[must_use]
    pub fn new(layout: ImageLayout, container: &Container) -> Self {
        let mut image = Image::zeroed(layout);
        image.apply_init_image(container);
        image
    }

    fn zeroed(layout: ImageLayout) -> Self {
        let align = REGION_ALIGN_BYTES as usize;
        let storage = vec![0; layout.total_bytes() as usize + align];
        // `align_offset` may in theory give up with usize::MAX; alignment is for speed only, so 0 is as right.
        let start = Some(storage.as_ptr().align_offset(align)).filter(|start| *start < align).unwrap_or(0);
        Image { layout, storage, start }
    }

    /// Puts every byte back to its initial value: origin reset.
    pub fn reset(&mut self, container: &Container) {
        self.bytes_mut().fill(0);
        self.apply_init_image(container);
    }

    fn apply_init_image(&mut self, container: &Container) {
        for run in &container.types.init_image {
            let region = self.layout.region(run.region);
            let bytes = &mut self.bytes_mut()[region.start as usize..region.end as usize];
            // The verifier holds every run inside its region.
            let target = bytes.iter_mut().skip(run.offset as usize);
            let source = run.bytes.iter().cycle().take(run.bytes.len() * run.repeat as usize);
            target.zip(source).for_each(|(to, from)| *to = *from);
        }
    }

    /// Where its regions lie.
    #[must_use]
    pub fn layout(&self) -> &ImageLayout {
        &self.layout
    }

    /// All its bytes.
    #[must_use]
    #[inline]
    pub fn bytes(&self) -> &[u8] {
        &self.storage[self.start..self.start + self.layout.total_bytes() as usize]
    }

    /// All its bytes.
    #[must_use]
    #[inline]
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        let range = self.start..self.start + self.layout.total_bytes() as usize;
        &mut self.storage[range]
    }

    /// The first offset at which two images of one layout differ, frame bytes excluded (dead frames are nobody's business).
    #[must_use]
    pub fn first_difference(&self, other: &Image) -> Option<u32> {
        let frames = self.layout.frames.first().map_or(0, |f| f.start)..self.layout.frames.last().map_or(0, |f| f.end);
        let (before, behind) = (..frames.start as usize, frames.end as usize..);
        // Images are equal nearly always, and then two comparisons of memory say so.
        if self.bytes()[before] == other.bytes()[before] && self.bytes()[behind.clone()] == other.bytes()[behind] {
            return None;
        }
        let pairs = self.bytes().iter().zip(other.bytes()).enumerate();
        let mut differing = pairs.filter(|(_, (a, b))| a != b).map(|(at, _)| at as u32);
        differing.find(|at| !frames.contains(at))
    }
}

impl Clone for Image {
    fn clone(&self) -> Self {
        // A copied buffer may lie at another address, so the start is found anew.
        let mut copy = Image::zeroed(self.layout.clone());
        copy.bytes_mut().copy_from_slice(self.bytes());
        copy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use khz_bytecode::container::{InitRun, Task};
    use khz_bytecode::value::Storage;

    fn container() -> Container {
        let mut container = Container::default();
        container.parameters.data_region_bytes = 100;
        container.parameters.frame_bytes = 24;
        container.parameters.memory_image_bytes = 3;
        container.parameters.output_image_bytes = 2;
        container.parameters.input_image_bytes = 1;
        container.types.slots = vec![Storage::I64; 9];
        container.tasks.tasks = vec![Task::default(); 2];
        let run = |region, offset, repeat, bytes: &[u8]| InitRun { region, offset, repeat, bytes: bytes.to_vec() };
        container.types.init_image = vec![
            run(Region::Slots, 8, 1, &[5]),
            run(Region::Data, 16, 3, &[1, 2]),
            run(Region::Memory, 2, 1, &[7]),
            run(Region::Output, 0, 2, &[9]),
        ];
        container
    }

    #[test]
    fn regions_follow_each_other_on_cache_lines() {
        let layout = ImageLayout::new(&container(), 1 << 20).unwrap();
        assert_eq!((layout.slots.clone(), layout.data.clone()), (0..72, 128..228));
        assert_eq!(layout.frames, [256..280, 320..344]);
        assert_eq!(
            (layout.memory.clone(), layout.output.clone(), layout.input.clone()),
            (384..387, 448..450, 512..513)
        );
        assert_eq!((layout.readable(), layout.writable(), layout.total_bytes()), (128..513, 128..450, 513));
        assert_eq!(layout.fixed_start(BytePlace::Memory), Some(384));
        assert_eq!(layout.fixed_start(BytePlace::This), None);
        assert!(Image::new(layout, &container()).bytes().as_ptr().align_offset(64) == 0);
    }

    #[test]
    fn an_image_beyond_the_limit_is_refused() {
        let refused = ImageLayout::new(&container(), 512).unwrap_err();
        assert_eq!(refused, ImageTooLarge { needed_bytes: 513, limit_bytes: 512 });
        assert!(refused.to_string().contains("--max-image"), "{refused}");
        let mut huge = container();
        huge.parameters.data_region_bytes = u32::MAX;
        huge.parameters.frame_bytes = u32::MAX;
        assert_eq!(ImageLayout::new(&huge, u64::MAX).unwrap_err().limit_bytes, i32::MAX as u64);
    }

    #[test]
    fn initial_values_come_back_at_reset() {
        let container = container();
        let fresh = Image::new(ImageLayout::new(&container, 1 << 20).unwrap(), &container);
        let bytes = fresh.bytes();
        assert_eq!(bytes[8..10], [5, 0]);
        assert_eq!(bytes[128 + 15..128 + 23], [0, 1, 2, 1, 2, 1, 2, 0]);
        assert_eq!((bytes[386], bytes[448], bytes[449], bytes[512]), (7, 9, 9, 0));
        let mut used = fresh.clone();
        assert_eq!(used.bytes(), fresh.bytes());
        used.bytes_mut().fill(0xEE);
        used.reset(&container);
        assert_eq!(used.bytes(), fresh.bytes());
    }

    #[test]
    fn images_differ_outside_frames() {
        let container = container();
        let image = Image::new(ImageLayout::new(&container, 1 << 20).unwrap(), &container);
        let mut other = image.clone();
        other.bytes_mut()[256..344].fill(1);
        assert_eq!(image.first_difference(&other), None);
        other.bytes_mut()[449] = 1;
        assert_eq!(image.first_difference(&other), Some(449));
        other.bytes_mut()[71] = 1;
        assert_eq!(image.first_difference(&other), Some(71));
    }
}
