//! Links by name of HDF5 files, which lead to another place of the file or to another file, and which the crate that reads them passes
//! over (HDF5 File Format Specification 3.0, III.C, IV.A.2.g). They are found by what they look like, wherever they stand.

use std::collections::{BTreeMap, BTreeSet};

/// The entry of a group that holds a link in place of an address (cache type 2 of a symbol table).
const LINK_ENTRY: usize = 2;
const ENTRY_BYTES: usize = 40;

/// Takes the links out of the symbol tables of a file, where the addresses that they lack would be looked for, and returns all links
/// of the file: their names, each with where it leads.
pub(super) fn take_links(bytes: &mut [u8]) -> BTreeMap<String, String> {
    let mut links: BTreeMap<String, String> =
        (0..bytes.len()).filter(|at| bytes[*at] == 1).filter_map(|at| message_at(&bytes[at..])).collect();
    let nodes: Vec<usize> = places(bytes, b"SNOD").filter(|node| has_links(bytes, *node)).collect();
    if !nodes.is_empty() {
        let heaps = heaps_of_nodes(bytes);
        for node in nodes {
            let heap = heaps.get(&node).copied();
            links.extend(take_entries(bytes, node, heap).unwrap_or_default());
        }
    }
    links
}

/// Returns a link of the newer kind that stands at the start of these bytes: version 1, flags, type 1 or 64, name and value.
fn message_at(bytes: &[u8]) -> Option<(String, String)> {
    let (flags, kind) = (*bytes.get(1)?, *bytes.get(2)?);
    // The kind stands there, and nothing that is not defined.
    if flags & 0b1110_1000 != 0b1000 || !matches!(kind, 1 | 64) {
        return None;
    }
    let at = 3 + if flags & 4 != 0 { 8 } else { 0 } + usize::from(flags & 16 != 0);
    let width = 1 << (flags & 3);
    let end = at + width + number(bytes, at, width)?;
    let name = text(bytes.get(at + width..end)?)?;
    let value = bytes.get(end + 2..end + 2 + number(bytes, end, 2)?)?;
    let target = match kind {
        1 => text(value)?,
        _ => {
            let mut parts = value.strip_prefix(b"\0")?.strip_suffix(b"\0")?.split(|byte| *byte == 0);
            let (file, place) = (text(parts.next()?)?, text(parts.next()?)?);
            format!("{place} of {file}")
        }
    };
    Some((name, target))
}

/// Returns the entries of a node of a symbol table.
fn entries_of(bytes: &[u8], node: usize) -> Option<impl Iterator<Item = &[u8]>> {
    let n = number(bytes, node + 6, 2)?;
    Some(bytes.get(node + 8..node + 8 + n * ENTRY_BYTES)?.chunks(ENTRY_BYTES))
}

fn is_link(entry: &[u8]) -> bool {
    number(entry, 16, 4) == Some(LINK_ENTRY) && entry[8..16] == [255; 8]
}

fn has_links(bytes: &[u8], node: usize) -> bool {
    entries_of(bytes, node).is_some_and(|mut entries| entries.any(is_link))
}

/// Returns where the names of each node of a symbol table stand: in the heap that a group names beside the tree of its nodes.
fn heaps_of_nodes(bytes: &[u8]) -> BTreeMap<usize, usize> {
    // Places are counted from the file's own mark, before which a program may have its own words.
    let start = places(bytes, b"\x89HDF").next().unwrap_or(0);
    let place = |at: usize| Some(start + number(bytes, at, 8)?);
    let [trees, heaps] = [b"TREE", b"HEAP"].map(|mark| places(bytes, mark).collect::<BTreeSet<_>>());
    let pairs = (0..bytes.len().saturating_sub(15))
        .filter_map(|at| Some((place(at).filter(|tree| trees.contains(tree))?, place(at + 8)?)))
        .filter(|(_, heap)| heaps.contains(heap));
    let mut found = BTreeMap::new();
    for (tree, heap) in pairs {
        let Some(names) = place(heap + 24) else { continue };
        let mut open = vec![tree];
        while let Some(at) = open.pop() {
            if found.insert(at, names).is_none() && trees.contains(&at) {
                let n = number(bytes, at + 6, 2).unwrap_or(0);
                open.extend((0..n).filter_map(|child| place(at + 32 + 16 * child)));
            }
        }
    }
    found
}

/// Takes the links out of a node of a symbol table, whose names stand there.
fn take_entries(bytes: &mut [u8], node: usize, names: Option<usize>) -> Option<Vec<(String, String)>> {
    let entries = entries_of(bytes, node)?.map(<[u8]>::to_vec);
    let (links, others): (Vec<Vec<u8>>, Vec<Vec<u8>>) = entries.partition(|entry| is_link(entry));
    let text_at = |entry: &[u8], at: usize, width: usize| {
        let rest = bytes.get(names? + number(entry, at, width)?..)?;
        text(&rest[..rest.iter().position(|byte| *byte == 0)?])
    };
    let named = |text: Option<String>| text.unwrap_or_else(|| "?".to_owned());
    let found = links.iter().map(|entry| (named(text_at(entry, 0, 8)), named(text_at(entry, 24, 4)))).collect();
    let left = others.concat();
    bytes[node + 8..node + 8 + left.len()].copy_from_slice(&left);
    bytes[node + 6..node + 8].copy_from_slice(&(others.len() as u16).to_le_bytes());
    Some(found)
}

/// Returns where these four bytes stand.
fn places<'a>(bytes: &'a [u8], mark: &'static [u8; 4]) -> impl Iterator<Item = usize> + 'a {
    (0..bytes.len().saturating_sub(4)).filter(move |at| bytes[*at] == mark[0] && bytes[*at..*at + 4] == *mark)
}

/// Returns a number of so many bytes, the least first, where it is a place in memory.
fn number(bytes: &[u8], at: usize, width: usize) -> Option<usize> {
    let own = bytes.get(at..at.checked_add(width)?)?;
    let number = own.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte));
    usize::try_from(number).ok().filter(|number| *number < 1 << 48)
}

/// Returns a text that can be a name.
fn text(bytes: &[u8]) -> Option<String> {
    let text = std::str::from_utf8(bytes).ok()?;
    (!text.is_empty() && !text.chars().any(char::is_control)).then(|| text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_of_both_kinds_are_found_and_taken_out() {
        let soft = [&[1, 0x08, 1, 4][..], b"soft", &5_u16.to_le_bytes(), b"/cube"].concat();
        let outside = [&[1, 0x18, 64, 0, 3][..], b"ext", &12_u16.to_le_bytes(), b"\0b.h5\0/cube\0"].concat();
        // A group of the older kind: names, a tree with a node, and the pair of their places that the group has.
        let (start, entry) = (8, |name: u64, address: u64, kind: u32, value: u32| {
            let place = [name.to_le_bytes(), address.to_le_bytes()].concat();
            [place, kind.to_le_bytes().to_vec(), vec![0; 4], value.to_le_bytes().to_vec(), vec![0; 12]].concat()
        });
        let mut file = [&[7; 8][..], b"\x89HDF\r\n\x1a\n", &[0; 8]].concat();
        let names = file.len();
        file.extend(b"\0cube\0old\0/cube\0\0\0");
        let heap = file.len();
        file.extend([&b"HEAP\0\0\0\0"[..], &[0; 16], &((names - start) as u64).to_le_bytes()].concat());
        let node = file.len();
        let entries = [entry(1, 800, 0, 0), entry(6, u64::MAX, 2, 10), entry(6, 900, 0, 0)].concat();
        file.extend([&b"SNOD\x01\0\x03\0"[..], &entries].concat());
        let tree = file.len();
        file.extend([&b"TREE\0\0\x01\0"[..], &[255; 16], &[0; 8], &((node - start) as u64).to_le_bytes()].concat());
        file.extend([tree, heap].map(|place| ((place - start) as u64).to_le_bytes()).concat());
        file.extend([soft, outside].concat());
        let links = take_links(&mut file);
        let expected = [("ext", "/cube of b.h5"), ("old", "/cube"), ("soft", "/cube")];
        assert!(links.iter().map(|(name, target)| (name.as_str(), target.as_str())).eq(expected), "{links:?}");
        assert_eq!(file[node + 6], 2);
        assert_eq!(file[node + 8 + ENTRY_BYTES..][..ENTRY_BYTES], entries[2 * ENTRY_BYTES..]);
        assert!(!has_links(&file, node));
    }

    #[test]
    fn what_only_looks_like_a_link_is_none() {
        for bytes in
            [&[1, 8, 1, 4, b's', b'o', 1, 0][..], &[1, 8, 64, 1, b'a', 2, 0, 1, 0], &[1, 8], b"SNOD\x01\0\xff\xff"]
        {
            assert!(take_links(&mut bytes.to_vec()).is_empty(), "{bytes:?}");
        }
    }
}
