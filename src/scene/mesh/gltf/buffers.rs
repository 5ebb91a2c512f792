//! The bytes of a glTF: the GLB's own chunk, files beside it, data URIs.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::json::{Root, buffer};
use percent_encoding::percent_decode_str;

use super::Problem;
use crate::scene::mesh::Problem as MeshProblem;
use crate::scene::mesh::beside::Beside;

/// The bytes of every buffer; `None` for those without any, which only compressed data needs.
pub(super) struct Buffers<'a>(Vec<Option<Cow<'a, [u8]>>>);

/// A view of a buffer.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub bytes: &'a [u8],
    /// Bytes from one element to the next, if they do not follow each other.
    pub stride: Option<usize>,
}

impl<'a> Buffers<'a> {
    /// Reads them all.
    pub fn open(root: &Root, binary: Option<&'a [u8]>, beside: &mut Beside<'_>) -> Result<Self, MeshProblem> {
        let open = |(index, buffer): (usize, &buffer::Buffer)| match &buffer.uri {
            Some(uri) => match data_of(uri, || format!("buffer {index}"))? {
                Some(bytes) => Ok(Some(Cow::Owned(bytes))),
                None => Ok(Some(Cow::Owned(beside.read("buffer", &decoded(uri))?))),
            },
            None if index == 0 => Ok(binary.map(Cow::Borrowed)),
            None => Ok(None),
        };
        Ok(Self(root.buffers.iter().enumerate().map(open).collect::<Result<_, MeshProblem>>()?))
    }

    /// The bytes of the view `index`, which `place` names.
    pub fn view(&self, root: &Root, index: usize, place: &str) -> Result<View<'_>, Problem> {
        let what = "buffer view";
        let view =
            root.buffer_views.get(index).ok_or_else(|| Problem::NoSuch { place: place.to_owned(), what, index })?;
        let of_buffer = view.buffer.value();
        let extension = ["EXT_meshopt_compression", "KHR_meshopt_compression"]
            .into_iter()
            .find(|name| view.extensions.as_ref().is_some_and(|all| all.others.contains_key(*name)));
        let absent = || match extension {
            Some(extension) => Problem::Compressed { place: place.to_owned(), extension },
            None => Problem::NoBytes { index: of_buffer },
        };
        let Some(buffer) = self.0.get(of_buffer) else {
            return Err(Problem::NoSuch { place: place.to_owned(), what: "buffer", index: of_buffer });
        };
        let buffer = buffer.as_ref().ok_or_else(absent)?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let needed = start.saturating_add(view.byte_length.0);
        let bytes = usize::try_from(start).ok().zip(usize::try_from(needed).ok());
        let bytes = bytes.and_then(|(start, end)| buffer.get(start..end)).ok_or_else(|| Problem::Short {
            index: of_buffer,
            place: place.to_owned(),
            found: buffer.len(),
            needed,
        })?;
        Ok(View { bytes, stride: view.byte_stride.map(|stride| stride.0) })
    }
}

/// The bytes of a data URI; `None` if it is another URI.
pub(super) fn data_of(uri: &str, what: impl Fn() -> String) -> Result<Option<Vec<u8>>, Problem> {
    let Some(data) = uri.strip_prefix("data:") else { return Ok(None) };
    let not_base64 = || Problem::DataUri { what: what() };
    let (kind, text) = data.split_once(',').ok_or_else(not_base64)?;
    if !kind.ends_with(";base64") {
        return Err(not_base64());
    }
    let text: Cow<'_, [u8]> = percent_decode_str(text.trim()).into();
    STANDARD.decode(text).map(Some).map_err(|_| not_base64())
}

/// A relative URI as a path.
pub(super) fn decoded(uri: &str) -> String {
    percent_decode_str(uri).decode_utf8_lossy().into_owned()
}
