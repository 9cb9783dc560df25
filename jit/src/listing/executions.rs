//! From counted blocks of Cranelift's form to blocks of machine code, some of which have no counterpart: where a jump is the only one to leave
//! its block that way and not the only one to reach its target, the registers that it moves lie in a block of their own.

/// How often each block of machine code was run. `starts`: their offsets, ascending; `edges`: from start to start; `known`: what was counted.
#[must_use]
pub fn executions(starts: &[u32], edges: &[(u32, u32)], known: &[Option<u64>]) -> Vec<u64> {
    let at = |offset: u32| starts.binary_search(&offset).ok();
    let mut into = vec![Vec::new(); starts.len()];
    let mut out = vec![Vec::new(); starts.len()];
    for (from, to) in edges {
        if let (Some(from), Some(to)) = (at(*from), at(*to)) {
            into[to].push(from);
            out[from].push(to);
        }
    }
    let known = |block: usize| known.get(block).copied().flatten();
    let count = |block: usize| {
        if let Some(count) = known(block) {
            return count;
        }
        let ([before], [behind]) = (into[block].as_slice(), out[block].as_slice()) else {
            // No such block is made; what can be said of it is that it is not run more often than what lies around it.
            let sum = |blocks: &[usize]| blocks.iter().filter_map(|block| known(*block)).sum::<u64>();
            return sum(&into[block]).min(sum(&out[block]));
        };
        // What comes in otherwise behind it, or leaves otherwise before it, if that is counted: the rest came this way.
        let others = |around: &[usize], single: &dyn Fn(usize) -> bool| {
            let others = around.iter().filter(|other| **other != block);
            others.map(|other| known(*other).filter(|_| single(*other))).sum::<Option<u64>>()
        };
        let rest = |total: usize, others: Option<u64>| Some(known(total)?.saturating_sub(others?));
        rest(*behind, others(&into[*behind], &|other| out[other].len() == 1))
            .or_else(|| rest(*before, others(&out[*before], &|other| into[other].len() == 1)))
            .or_else(|| Some(known(*before)?.min(known(*behind)?)))
            .unwrap_or(0)
    };
    (0..starts.len()).map(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_back_with_moves_of_its_own_is_what_did_not_leave() {
        // 0 → 10; 10 → 20 (moves) → 10; 10 → 30 (moves) → 40; 0 → 40: nothing of 10's way out is counted but by difference.
        let edges = [(0, 10), (0, 40), (10, 20), (20, 10), (10, 30), (30, 40)];
        let known = [Some(7), Some(100), None, None, Some(7)];
        assert_eq!(executions(&[0, 10, 20, 30, 40], &edges, &known)[..2], [7, 100]);
        // 0 → 10 always: then of 100 turns 5 came in from 0, and 95 went back.
        let edges = [(0, 10), (10, 20), (20, 10), (10, 30)];
        assert_eq!(executions(&[0, 10, 20, 30], &edges, &[Some(5), Some(100), None, Some(5)]), [5, 100, 95, 5]);
    }

    #[test]
    fn where_the_difference_is_not_known_the_smaller_neighbour_bounds_it() {
        let edges = [(0, 10), (0, 20), (10, 30), (20, 30), (5, 20), (5, 30)];
        let counted = executions(&[0, 5, 10, 20, 30], &edges, &[Some(8), Some(3), None, Some(6), Some(9)]);
        assert_eq!(counted[2], 8, "{counted:?}");
    }
}
