//! What programs write beside pictures as XMP (ISO 16684-1): properties of an XML text, by their names with the usual prefixes.

/// Prefixes of the frame that properties stand in.
const FRAME: [&str; 4] = ["rdf", "x", "xml", "xmlns"];

/// Returns the properties of XMP data, be they attributes or elements, each with its text; of data that are cut short those that are there.
pub fn xmp_properties(bytes: &[u8]) -> Vec<(String, String)> {
    let text = String::from_utf8_lossy(bytes);
    let mut found: Vec<(String, String)> = vec![];
    for tag in text.split('<').skip(1).filter(|tag| !tag.starts_with(['/', '!', '?'])) {
        let (inner, behind) = tag.split_once('>').unwrap_or((tag, ""));
        let end = inner.find(|c: char| c.is_whitespace() || c == '/').unwrap_or(inner.len());
        found.push((inner[..end].to_owned(), behind.trim().to_owned()));
        let mut rest = &inner[end..];
        while let Some((name, value)) = rest.split_once('=') {
            let value = value.trim_start();
            let Some(quote) = value.chars().next().filter(|c| ['"', '\''].contains(c)) else { break };
            let (value, next) = value[1..].split_once(quote).unwrap_or((&value[1..], ""));
            found.push((name.trim().to_owned(), value.trim().to_owned()));
            rest = next;
        }
    }
    found.retain(|(name, _)| {
        name.split_once(':').is_some_and(|(prefix, own)| !FRAME.contains(&prefix) && !own.is_empty())
    });
    found
}

/// Returns the number of a property, which may be a ratio.
pub(crate) fn number_of(text: &str) -> Option<f64> {
    let (over, under) = text.split_once('/').unwrap_or((text, "1"));
    let number = over.trim().parse::<f64>().ok()? / under.trim().parse::<f64>().ok()?;
    number.is_finite().then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn properties_are_attributes_and_elements() {
        let text =
            b"<?xpacket?><x:xmpmeta xmlns:x='adobe:ns:meta/'><rdf:Description exif:FocalLength = \"50/2\" dc:x='a>b'>\
            <exif:Gamma> 2.2 </exif:Gamma><rdf:li Item:Semantic='Depth'/></rdf:Description><exif:Cut a:b=\"c";
        let found = xmp_properties(text);
        let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["exif:FocalLength", "dc:x", "exif:Gamma", "Item:Semantic", "exif:Cut", "a:b"]);
        assert_eq!((number_of(&found[0].1), number_of(&found[2].1)), (Some(25.0), Some(2.2)));
        assert_eq!([number_of("1/0"), number_of("a")], [None; 2]);
        for end in 0..text.len() {
            xmp_properties(&text[..end]);
        }
    }
}
