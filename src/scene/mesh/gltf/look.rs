//! Materials: base colour and its texture, metallic-roughness or specular-glossiness, with `KHR_texture_transform`. A picture in
//! a format that gprop does not decode is replaced by the fallback that the file has, or by the base colour.

use gltf::json::material::AlphaMode;
use gltf::json::texture::{Info, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{self};
use serde::Deserialize;
use serde_json::Value;

use super::buffers::{data_of, decoded};
use super::{Document, Problem};
use crate::scene::mesh::assembly::Assembly;
use crate::scene::mesh::beside::{Beside, shortened};
use crate::scene::mesh::texture::Source;
use crate::scene::mesh::{Alpha, Material, Picture, Problem as MeshProblem, Texture, Wrapping};

/// Which coordinates place a material's texture, and how.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    /// The set of texture coordinates: `TEXCOORD_n`.
    pub set: u32,
    /// `KHR_texture_transform`: the rows of the matrix that acts on (u, v, 1).
    pub rows: [[f64; 3]; 2],
}

impl Placement {
    /// The coordinates in the picture.
    pub fn apply(&self, [u, v]: [f64; 2]) -> [f32; 2] {
        self.rows.map(|[a, b, c]| (a * u + b * v + c) as f32)
    }
}

/// The placements of the materials' textures, by the file's index of the material. The last one is that of no material.
pub(super) fn read(
    document: &Document<'_>,
    beside: &mut Beside<'_>,
    assembly: &mut Assembly,
) -> Result<Vec<Option<Placement>>, MeshProblem> {
    let mut look = Look { document, beside, assembly, picture_of_image: vec![None; document.root.images.len()] };
    let mut placements = Vec::new();
    for (index, material) in document.root.materials.iter().enumerate() {
        placements.push(look.material(index, material)?);
    }
    look.assembly.materials.push(Material::default());
    look.assembly.material_names.push(String::new());
    placements.push(None);
    Ok(placements)
}

struct Look<'a, 'b, 'p> {
    document: &'a Document<'a>,
    beside: &'b mut Beside<'p>,
    assembly: &'b mut Assembly,
    /// By the file's index of the image; an image that cannot be used has none.
    picture_of_image: Vec<Option<Option<u32>>>,
}

impl Look<'_, '_, '_> {
    fn material(&mut self, index: usize, from: &json::Material) -> Result<Option<Placement>, MeshProblem> {
        let place = format!("material {index}");
        let pbr = &from.pbr_metallic_roughness;
        let extension = from.extensions.as_ref().and_then(|all| all.others.get("KHR_materials_pbrSpecularGlossiness"));
        let (base_color, texture) = match extension {
            Some(glossy) if pbr.base_color_texture.is_none() => (
                floats(glossy.get("diffuseFactor")).unwrap_or([1.0; 4]),
                glossy.get("diffuseTexture").and_then(|info| Info::deserialize(info).ok()),
            ),
            _ => (pbr.base_color_factor.0, pbr.base_color_texture.clone()),
        };
        let alpha = match from.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Alpha::CutBelow(from.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0)),
            Checked::Valid(AlphaMode::Blend) => Alpha::Blend,
            _ => Alpha::Opaque,
        };
        let is_color = base_color.iter().all(|value| value.is_finite());
        let mut material = Material {
            base_color: if is_color { base_color.map(|value| value.clamp(0.0, 1.0)) } else { [1.0; 4] },
            texture: None,
            alpha,
        };
        let mut placement = None;
        if let Some(info) = texture {
            material.texture = self.texture(info.index.value(), &place)?;
            placement = material.texture.map(|_| placement_of(&info));
        }
        self.assembly.materials.push(material);
        self.assembly.material_names.push(from.name.clone().unwrap_or_default());
        Ok(placement)
    }

    /// The texture `index`, if one of its pictures can be used.
    fn texture(&mut self, index: usize, place: &str) -> Result<Option<Texture>, MeshProblem> {
        let root = &self.document.root;
        let no_such = |what, index| Problem::NoSuch { place: place.to_owned(), what, index };
        let texture = root.textures.get(index).ok_or_else(|| no_such("texture", index))?;
        let extensions = texture.extensions.as_ref().map(|all| &all.others);
        let webp = extensions.and_then(|all| all.get("EXT_texture_webp"));
        let webp = webp.and_then(|webp| webp.get("source")).and_then(Value::as_u64).map(|index| index as usize);
        // A texture with only an extension's picture has no source.
        let plain = Some(texture.source.value()).filter(|source| *source != u32::MAX as usize);
        let mut picture = None;
        for image in webp.into_iter().chain(plain) {
            if image >= root.images.len() {
                return Err(no_such("image", image).into());
            }
            picture = picture.or(self.picture(image)?);
        }
        let Some(picture) = picture else {
            let unread: Vec<&str> = extensions.into_iter().flatten().map(|(name, _)| name.as_str()).collect();
            let why = if unread.is_empty() { String::new() } else { format!(" ({})", shortened(&unread.join(", "))) };
            let warning = format!(
                "{place}: gprop reads none of the pictures of texture {index}{why}; it is shown in its base colour. To read it, \
                 convert the textures to PNG, for example with `gltf-transform png IN OUT` (npm)"
            );
            self.assembly.warnings.push(warning);
            return Ok(None);
        };
        let sampler = match texture.sampler {
            Some(index) => Some(root.samplers.get(index.value()).ok_or_else(|| no_such("sampler", index.value()))?),
            None => None,
        };
        let wrapping =
            sampler.map_or([Wrapping::Repeat; 2], |sampler| [sampler.wrap_s, sampler.wrap_t].map(wrapping_of));
        Ok(Some(Texture { picture, wrapping }))
    }

    /// The picture of the image `index`; `None` if it is not there or its format is not one that gprop decodes.
    fn picture(&mut self, index: usize) -> Result<Option<u32>, MeshProblem> {
        if let Some(known) = self.picture_of_image[index] {
            return Ok(known);
        }
        let source = self.source(index)?.filter(|source| match source {
            Source::Bytes(bytes) => image::guess_format(bytes).is_ok(),
            Source::File(_) => true,
        });
        let picture = source.map(|source| {
            let place = match &source {
                Source::Bytes(_) => format!("image {index}"),
                Source::File(path) => format!("`{}`", path.display()),
            };
            self.assembly.pictures.push(Picture { source, place });
            self.assembly.pictures.len() as u32 - 1
        });
        self.picture_of_image[index] = Some(picture);
        Ok(picture)
    }

    fn source(&mut self, index: usize) -> Result<Option<Source>, MeshProblem> {
        let image = &self.document.root.images[index];
        let place = format!("image {index}");
        if let Some(view) = image.buffer_view {
            let view = self.document.buffers.view(&self.document.root, view.value(), &place)?;
            return Ok(Some(Source::Bytes(view.bytes.into())));
        }
        let Some(uri) = &image.uri else { return Ok(None) };
        if let Some(bytes) = data_of(uri, || place.clone())? {
            return Ok(Some(Source::Bytes(bytes.into())));
        }
        let name = decoded(uri);
        let is_other_format = [".ktx2", ".ktx", ".basis", ".dds", ".avif"].iter().any(|ending| name.ends_with(ending));
        let found = if is_other_format { None } else { self.beside.find_picture(&name)? };
        if found.is_none() && !is_other_format {
            self.assembly
                .warnings
                .push(format!("texture `{}` is not there; its material is shown in its base colour", shortened(&name)));
        }
        Ok(found.map(Source::File))
    }
}

fn wrapping_of(mode: Checked<WrappingMode>) -> Wrapping {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrapping::ClampToEdge,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrapping::MirroredRepeat,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrapping::Repeat,
    }
}

/// `KHR_texture_transform`: scaled, then rotated, then moved: T R S (u, v, 1), with the specification's sense of rotation.
fn placement_of(info: &Info) -> Placement {
    let transform = info.extensions.as_ref().and_then(|all| all.others.get("KHR_texture_transform"));
    let get = |name| transform.and_then(|transform| transform.get(name));
    let [x, y] = floats(get("offset")).unwrap_or([0.0; 2]).map(f64::from);
    let [width, height] = floats(get("scale")).unwrap_or([1.0; 2]).map(f64::from);
    let (sin, cos) = get("rotation").and_then(Value::as_f64).unwrap_or(0.0).sin_cos();
    let set = get("texCoord").and_then(Value::as_u64).map_or(info.tex_coord, |set| set as u32);
    Placement { set, rows: [[cos * width, sin * height, x], [-sin * width, cos * height, y]] }
}

/// An array of `N` numbers.
fn floats<const N: usize>(value: Option<&Value>) -> Option<[f32; N]> {
    let values: Vec<f32> = value?.as_array()?.iter().filter_map(Value::as_f64).map(|value| value as f32).collect();
    values.try_into().ok()
}
