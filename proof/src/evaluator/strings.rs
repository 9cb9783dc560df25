//! The string rows on copied bytes: what is short is written anew here, number and time texts are those of `khz_machine`.

use khz_bytecode::instruction::HelperOp;
use khz_machine::semantics::{StringPlace, Value, eval_helper};

/// Bytes before the terminator, at most as many as the capacity.
fn text(image: &[u8], place: StringPlace) -> Vec<u8> {
    let start = place.at as usize;
    let room = &image[start..start + usize::from(place.capacity)];
    room.iter().copied().take_while(|byte| *byte != 0).collect()
}

fn put(image: &mut [u8], place: StringPlace, text: &[u8]) {
    let start = place.at as usize;
    let len = text.len().min(usize::from(place.capacity));
    image[start..start + len].copy_from_slice(&text[..len]);
    image[start + len] = 0;
}

/// `count` cut to 0..=`most`.
fn clamp(count: i64, most: usize) -> usize {
    count.clamp(0, most as i64) as usize
}

/// Does one string instruction.
///
/// # Panics
/// When a place lies outside the image.
pub(super) fn apply(op: HelperOp, image: &mut [u8], places: &[StringPlace], values: &[Value]) -> Option<Value> {
    let number = |at: usize| match values.get(at) {
        Some(Value::I32(value)) => i64::from(*value),
        Some(Value::I64(value)) => *value,
        _ => 0,
    };
    let texts: Vec<Vec<u8>> = places.iter().map(|place| text(image, *place)).collect();
    // The first source: behind the destination, when there is one.
    let source = texts.get(1).cloned().unwrap_or_default();
    let (before, behind) = {
        let start = clamp(number(1).saturating_sub(1), source.len());
        let end = start + clamp(number(0), source.len() - start);
        (start, end)
    };
    let result = match op {
        HelperOp::StringAssign => source,
        HelperOp::StringLeft => source[..clamp(number(0), source.len())].to_vec(),
        HelperOp::StringRight => source[source.len() - clamp(number(0), source.len())..].to_vec(),
        HelperOp::StringMid => source[before..behind].to_vec(),
        HelperOp::StringConcat => [&source[..], &texts[2]].concat(),
        HelperOp::StringInsert => {
            let at = clamp(number(0), source.len());
            [&source[..at], &texts[2], &source[at..]].concat()
        }
        HelperOp::StringDelete => [&source[..before], &source[behind..]].concat(),
        HelperOp::StringReplace => [&source[..before], &texts[2], &source[behind..]].concat(),
        HelperOp::StringFromI64 => number(0).to_string().into_bytes(),
        HelperOp::StringFromU64 => (number(0) as u64).to_string().into_bytes(),
        HelperOp::StringFromBool => if number(0) == 0 { "FALSE" } else { "TRUE" }.into(),
        HelperOp::StringLen => return Some(Value::I32(texts[0].len() as i32)),
        HelperOp::StringFind => return Some(Value::I32(find(&texts[0], &texts[1]))),
        HelperOp::StringCompare => return Some(Value::I32(texts[0].cmp(&texts[1]) as i32)),
        HelperOp::StringToBool => return Some(Value::I32(i32::from(texts[0].eq_ignore_ascii_case(b"TRUE")))),
        _ => return eval_helper(op, image, places, values),
    };
    put(image, places[0], &result);
    None
}

fn find(text: &[u8], wanted: &[u8]) -> i32 {
    if wanted.is_empty() {
        return 0;
    }
    text.windows(wanted.len()).position(|part| part == wanted).map_or(0, |at| at as i32 + 1)
}
