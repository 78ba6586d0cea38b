//! Text in UTF-16, as spreadsheets and shells on Windows save it: read as the same text in UTF-8.

use std::borrow::Cow;

/// The order of the bytes of a UTF-16 text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    Little,
    Big,
}

/// Whether these first bytes are of a text in UTF-16.
pub(crate) fn is_utf16(head: &[u8]) -> bool {
    order(head).is_some()
}

/// The order of bytes and the length of the mark that states it; `None` where this is not UTF-16.
fn order(head: &[u8]) -> Option<(Order, usize)> {
    let text = |b: u8| (b' '..0x7f).contains(&b) || matches!(b, b'\t' | b'\r' | b'\n');
    match head {
        // The mark of UTF-32.
        [0xff, 0xfe, 0, 0, ..] => None,
        [0xff, 0xfe, ..] => Some((Order::Little, 2)),
        [0xfe, 0xff, ..] => Some((Order::Big, 2)),
        // Without a mark: two letters of ASCII.
        &[a, 0, b, 0, ..] if text(a) && text(b) => Some((Order::Little, 0)),
        &[0, a, 0, b, ..] if text(a) && text(b) => Some((Order::Big, 0)),
        _ => None,
    }
}

/// The same text in UTF-8 without a byte order mark; other bytes as they are.
///
/// # Errors
/// The first byte that is not UTF-16, from 0.
pub fn utf8(bytes: &[u8]) -> Result<Cow<'_, [u8]>, u64> {
    let Some((order, mark)) = order(bytes) else {
        let plain = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        return Ok(Cow::Borrowed(plain));
    };
    let pairs = bytes[mark..].chunks_exact(2);
    if !pairs.remainder().is_empty() {
        return Err(bytes.len() as u64 - 1);
    }
    let units = pairs.map(|pair| match order {
        Order::Little => u16::from_le_bytes([pair[0], pair[1]]),
        Order::Big => u16::from_be_bytes([pair[0], pair[1]]),
    });
    let mut text = String::with_capacity(bytes.len() / 2);
    let mut at = mark as u64;
    for c in char::decode_utf16(units) {
        let c = c.map_err(|_| at)?;
        at += 2 * c.len_utf16() as u64;
        text.push(c);
    }
    Ok(Cow::Owned(text.into_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_are_read_with_and_without_a_mark_and_other_bytes_are_left() {
        let text = "a;°\r\n1;𝄞\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let with = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        for bytes in [
            with(&[0xff, 0xfe], &little),
            with(&[0xfe, 0xff], &big),
            little.clone(),
            big,
        ] {
            assert_eq!(utf8(&bytes).expect("text").as_ref(), text.as_bytes());
        }
        for other in [
            &b"plain"[..],
            b"\0\0\0\0",
            b"\xff\xfe\0\0a\0\0\0",
            b"a\0\x01\0",
        ] {
            assert_eq!(utf8(other), Ok(Cow::Borrowed(other)));
        }
        assert_eq!(utf8(b"\xef\xbb\xbfa").expect("text").as_ref(), b"a");
        // Cut within a character, and half of a pair of surrogates.
        assert_eq!(utf8(&with(&[0xff, 0xfe], &little[..3])), Err(4));
        assert_eq!(utf8(&[0xff, 0xfe, b'a', 0, 0x34, 0xd8, b'b', 0]), Err(4));
    }
}
