//! The book as HTML, by mdBook where the machine has it.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, bail, ensure};

/// Where the book lies in the repository.
const BOOK: &str = "docs/book";
/// What its pages lead to, beside crates' READMEs.
const BESIDE: [&str; 3] = ["docs", "examples", "fixtures/worlds"];

/// Lays the book out in `target/book` with the pages that it leads to, and builds it there.
pub(crate) fn run() -> anyhow::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folder = root.join("target/book");
    lay_out(&root, &folder)?;
    let status = match Command::new("mdbook").arg("build").arg(&folder).status() {
        Ok(status) => status,
        Err(error) => bail!("mdbook cannot be started ({error}): install it with `cargo install mdbook`"),
    };
    ensure!(status.success(), "mdbook build {}: {status}", folder.display());
    Ok(())
}

/// Copies the book and what its pages lead to, each to the same place below `src`, and lists all pages.
///
/// mdBook makes pages of those files alone that its summary lists, and only of what lies below its source.
fn lay_out(root: &Path, folder: &Path) -> anyhow::Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let source = folder.join("src");
    for beside in BESIDE {
        copy(&root.join(beside), &source.join(beside))?;
    }
    let mut crates = entries(&root.join("crates"))?;
    crates.sort();
    for krate in &crates {
        let readme = krate.join("README.md");
        if readme.is_file() {
            copy(&readme, &source.join(readme.strip_prefix(root)?))?;
        }
    }
    let book = fs::read_to_string(root.join(BOOK).join("src/SUMMARY.md")).context("the summary of the book")?;
    let mut summary = book.replace("](", &format!("]({BOOK}/src/"));
    summary += "\n# Beside the book\n\n";
    let mut pages = Vec::new();
    pages_below(&source, &mut pages)?;
    pages.sort();
    for page in pages.iter().filter(|page| !page.starts_with(source.join(BOOK))) {
        let text = fs::read_to_string(page).with_context(|| page.display().to_string())?;
        let title = text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("Page");
        let place = page.strip_prefix(&source)?.to_string_lossy().replace('\\', "/");
        summary += &format!("- [{title}]({place})\n");
    }
    fs::write(source.join("SUMMARY.md"), summary).context("the summary")?;
    fs::remove_file(source.join(BOOK).join("src/SUMMARY.md")).context("the summary of the book")?;
    fs::copy(root.join(BOOK).join("book.toml"), folder.join("book.toml")).context("book.toml")?;
    Ok(())
}

fn entries(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    entries.map(|entry| Ok(entry?.path())).collect()
}

fn copy(from: &Path, to: &Path) -> anyhow::Result<()> {
    if from.is_dir() {
        return entries(from)?.iter().try_for_each(|entry| copy(entry, &to.join(entry.file_name().context("a name")?)));
    }
    let folder = to.parent().context("a file lies in a folder")?;
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    fs::copy(from, to).with_context(|| from.display().to_string())?;
    Ok(())
}

fn pages_below(folder: &Path, pages: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    for entry in entries(folder)? {
        if entry.is_dir() {
            pages_below(&entry, pages)?;
        } else if entry.extension().is_some_and(|extension| extension == "md") {
            pages.push(entry);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_page_of_the_summary_is_laid_out() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let folder = std::env::temp_dir().join(format!("dioptric-book-{}", std::process::id()));
        lay_out(&root, &folder).unwrap();
        let summary = fs::read_to_string(folder.join("src/SUMMARY.md")).unwrap();
        let places: Vec<&str> = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
        let missing: Vec<_> = places.iter().filter(|place| !folder.join("src").join(place).is_file()).collect();
        let (n_places, has_toml) = (places.len(), folder.join("book.toml").is_file());
        fs::remove_dir_all(&folder).unwrap();
        assert!(missing.is_empty(), "{missing:?}");
        assert!(n_places > 40 && has_toml, "{n_places} pages");
    }
}
