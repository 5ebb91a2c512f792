//! Numbers out of buffers: every component type, normalised or not, strided and sparse.

use gltf::json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf::json::validation::Checked;

use super::{Document, Problem};
use crate::scene::mesh::{MOST_VERTICES, Problem as MeshProblem};

impl Document<'_> {
    /// The vectors of the accessor `index`, which `place` names; missing components are those of `default`. Integers that
    /// are normalised become fractions, others their value.
    pub(super) fn vectors<const N: usize>(
        &self,
        index: usize,
        place: &str,
        default: [f64; N],
    ) -> Result<Vec<[f64; N]>, MeshProblem> {
        let layout = self.layout(index, place)?;
        let mut vectors = vec![default; layout.count];
        if let Some(view) = layout.accessor.buffer_view {
            let rows = self.rows(&layout, view.value(), layout.offset)?;
            for (vector, row) in vectors.iter_mut().zip(rows) {
                layout.decode(row, vector);
            }
        } else {
            // Zeros, by the specification, where no sparse value replaces them.
            vectors.fill([0.0; N]);
        }
        if let Some(sparse) = &layout.accessor.sparse {
            let place = format!("{place}, sparse");
            let problem = |problem| Problem::Accessor { place: place.clone(), problem };
            let count = usize::try_from(sparse.count.0).ok().filter(|count| *count <= layout.count);
            let count = count.ok_or_else(|| problem("more sparse values than values"))?;
            let Checked::Valid(kind) = sparse.indices.component_type else {
                return Err(problem("a type of index that glTF 2 does not have").into());
            };
            let of_indices = Layout {
                count,
                kind: kind.0,
                components: 1,
                offset: sparse.indices.byte_offset.0,
                place: &place,
                ..layout
            };
            let of_values = Layout { count, offset: sparse.values.byte_offset.0, place: &place, ..layout };
            let indices = self.rows(&of_indices, sparse.indices.buffer_view.value(), of_indices.offset)?;
            let values = self.rows(&of_values, sparse.values.buffer_view.value(), of_values.offset)?;
            for (index, row) in indices.zip(values) {
                let index = whole(kind.0, index) as usize;
                let vector = vectors.get_mut(index).ok_or_else(|| problem("a sparse index out of range"))?;
                layout.decode(row, vector);
            }
        }
        Ok(vectors)
    }

    /// The whole numbers of the accessor `index`, which `place` names.
    pub(super) fn indices(&self, index: usize, place: &str) -> Result<Vec<u32>, MeshProblem> {
        let layout = self.layout(index, place)?;
        let is_whole = matches!(layout.kind, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        let view = layout.accessor.buffer_view.filter(|_| is_whole && layout.components == 1);
        let problem = "indices are not whole numbers in a buffer view";
        let view = view.ok_or_else(|| Problem::Accessor { place: place.to_owned(), problem })?;
        Ok(self.rows(&layout, view.value(), layout.offset)?.map(|row| whole(layout.kind, row)).collect())
    }

    /// Number of elements of the accessor.
    pub(super) fn count(&self, index: usize) -> Option<u64> {
        self.root.accessors.get(index).map(|accessor| accessor.count.0)
    }

    /// True if the accessor has values of its own: some exporters leave them out where compressed data replaces them.
    pub(super) fn has_values(&self, index: usize) -> bool {
        let accessor = self.root.accessors.get(index);
        accessor.is_some_and(|accessor| accessor.buffer_view.is_some() || accessor.sparse.is_some())
    }

    fn layout<'a>(&'a self, index: usize, place: &'a str) -> Result<Layout<'a>, MeshProblem> {
        let no_such = || Problem::NoSuch { place: place.to_owned(), what: "accessor", index };
        let accessor = self.root.accessors.get(index).ok_or_else(no_such)?;
        let (Checked::Valid(GenericComponentType(kind)), Checked::Valid(shape)) =
            (accessor.component_type, accessor.type_)
        else {
            let problem = "a type of number that glTF 2 does not have";
            return Err(Problem::Accessor { place: place.to_owned(), problem }.into());
        };
        let components = match shape {
            Type::Scalar => 1,
            Type::Vec2 => 2,
            Type::Vec3 => 3,
            Type::Vec4 => 4,
            Type::Mat2 | Type::Mat3 | Type::Mat4 => {
                let problem = "matrices, where vectors or numbers belong";
                return Err(Problem::Accessor { place: place.to_owned(), problem }.into());
            }
        };
        // Three indices per triangle are the most that a mesh within the limits needs of anything.
        const MOST_VALUES: u64 = 3 * MOST_VERTICES as u64;
        if accessor.count.0 > MOST_VALUES {
            return Err(MeshProblem::TooMany { place: place.to_owned(), what: "values", most: MOST_VALUES });
        }
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        Ok(Layout { accessor, count: accessor.count.0 as usize, kind, components, offset, place })
    }

    /// The bytes of each element.
    fn rows<'a>(
        &'a self,
        layout: &Layout<'_>,
        view: usize,
        offset: u64,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, MeshProblem> {
        let view = self.buffers.view(&self.root, view, layout.place)?;
        let problem = |problem| Problem::Accessor { place: layout.place.to_owned(), problem };
        let size = layout.kind.size() * layout.components;
        let stride = view.stride.unwrap_or(size);
        if stride < size {
            return Err(problem("elements overlap in their buffer view").into());
        }
        let count = layout.count as u64;
        let length = count.saturating_sub(1) * stride as u64 + if count > 0 { size as u64 } else { 0 };
        let end = offset.saturating_add(length);
        let bytes = usize::try_from(offset).ok().zip(usize::try_from(end).ok());
        let bytes = bytes.and_then(|(start, end)| view.bytes.get(start..end));
        let bytes = bytes.ok_or_else(|| problem("it goes beyond the end of its buffer view"))?;
        Ok(bytes.chunks(stride).map(move |row| &row[..size]))
    }
}

/// How an accessor's values are stored.
#[derive(Clone, Copy)]
struct Layout<'a> {
    accessor: &'a Accessor,
    count: usize,
    kind: ComponentType,
    components: usize,
    offset: u64,
    /// What names the accessor, for messages.
    place: &'a str,
}

impl Layout<'_> {
    /// Decodes an element; components beyond those of `vector` are left out.
    fn decode<const N: usize>(&self, row: &[u8], vector: &mut [f64; N]) {
        let values = row.chunks_exact(self.kind.size());
        for (to, from) in vector.iter_mut().zip(values) {
            let (value, full) = match self.kind {
                ComponentType::F32 => (f64::from(f32::from_le_bytes(array(from))), 1.0),
                ComponentType::I8 => (f64::from(i8::from_le_bytes(array(from))), 127.0),
                ComponentType::I16 => (f64::from(i16::from_le_bytes(array(from))), 32_767.0),
                ComponentType::U8 => (f64::from(from[0]), 255.0),
                ComponentType::U16 => (f64::from(u16::from_le_bytes(array(from))), 65_535.0),
                ComponentType::U32 => (f64::from(u32::from_le_bytes(array(from))), f64::from(u32::MAX)),
            };
            *to = if self.accessor.normalized { (value / full).max(-1.0) } else { value };
        }
    }
}

/// A whole number; 0 for types that hold others.
fn whole(kind: ComponentType, bytes: &[u8]) -> u32 {
    match kind {
        ComponentType::U8 => u32::from(bytes[0]),
        ComponentType::U16 => u32::from(u16::from_le_bytes(array(bytes))),
        ComponentType::U32 => u32::from_le_bytes(array(bytes)),
        ComponentType::I8 | ComponentType::I16 | ComponentType::F32 => 0,
    }
}

fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.try_into().expect("a value has its type's bytes")
}
