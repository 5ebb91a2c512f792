//! MTL: the materials of an OBJ. Of each, the diffuse colour, its texture and its opacity count.

use super::{Line, Lines, Problem};
use crate::scene::mesh::assembly::Assembly;
use crate::scene::mesh::beside::{Beside, shortened};
use crate::scene::mesh::texture::{Source, linear};
use crate::scene::mesh::{Alpha, Material, Picture, Problem as MeshProblem, Texture, Wrapping};

/// The most materials that are kept.
const MOST_MATERIALS: usize = 100_000;

/// The materials with their names, in the file's order; their pictures go into `assembly`. `file` is the MTL's name.
pub(super) fn read(
    bytes: &[u8],
    file: &str,
    beside: &mut Beside<'_>,
    assembly: &mut Assembly,
) -> Result<Vec<(String, Material)>, MeshProblem> {
    let mut materials: Vec<(String, Material)> = Vec::new();
    for line in Lines::new(bytes) {
        let Some((statement, rest)) = split_statement(&line) else { continue };
        if statement == "newmtl" {
            if materials.len() == MOST_MATERIALS {
                let place = format!("{file}: line {}", line.number);
                return Err(MeshProblem::TooMany { place, what: "materials", most: MOST_MATERIALS as u64 });
            }
            materials.push((rest.to_owned(), Material::default()));
        }
        let Some((_, material)) = materials.last_mut() else { continue };
        match statement {
            "Kd" => material.base_color[..3].copy_from_slice(&color(rest, &line, file)?),
            "d" => set_opacity(material, rest.trim_start_matches("-halo"), false),
            "Tr" => set_opacity(material, rest, true),
            "map_Kd" | "map_kd" => {
                if let Some(texture) = texture(rest, beside, assembly)? {
                    // The colour beside a texture is often a leftover of the exporter (black, or 0.8), which most programs ignore.
                    material.base_color[..3].fill(1.0);
                    material.texture = Some(texture);
                }
            }
            _ => {}
        }
        if statement == "Kd" && material.texture.is_some() {
            material.base_color[..3].fill(1.0);
        }
    }
    Ok(materials)
}

fn split_statement<'a>(line: &'a Line<'_>) -> Option<(&'a str, &'a str)> {
    let text = line.text.trim();
    let statement = text.split_ascii_whitespace().next()?;
    Some((statement, text[statement.len()..].trim()))
}

/// `Kd r g b`, or one number for all three; sRGB values.
fn color(rest: &str, line: &Line<'_>, file: &str) -> Result<[f32; 3], Problem> {
    let values: Vec<f64> = rest.split_ascii_whitespace().map_while(|word| word.parse().ok()).collect();
    let [r, g, b] = match values.as_slice() {
        [r, g, b, ..] => [*r, *g, *b],
        [grey] => [*grey; 3],
        _ => {
            let problem = line.problem("a colour has three numbers");
            return Err(Problem { file: format!("{file}: "), ..problem });
        }
    };
    Ok([r, g, b].map(linear))
}

/// An opacity that is not a number is left out: many exporters write none.
fn set_opacity(material: &mut Material, rest: &str, is_transparency: bool) {
    let Some(value) = rest.trim().parse::<f32>().ok().filter(|value| (0.0..=1.0).contains(value)) else { return };
    let opacity = if is_transparency { 1.0 - value } else { value };
    // Exporters that mistake one for the other write 0 for every opaque material.
    if opacity > 0.0 {
        material.base_color[3] = opacity;
        material.alpha = if opacity < 1.0 { Alpha::Blend } else { Alpha::Opaque };
    }
}

/// The texture of `map_Kd [options] file`; `None`, with a warning, if the file is not there.
fn texture(rest: &str, beside: &mut Beside<'_>, assembly: &mut Assembly) -> Result<Option<Texture>, MeshProblem> {
    let (name, is_clamped) = without_options(rest);
    let name = name.replace('\\', "/");
    if name.is_empty() {
        return Ok(None);
    }
    let Some(path) = beside.find_picture(&name)? else {
        let warning = format!("texture `{}` is not there; its material is shown in its base colour", shortened(&name));
        assembly.warnings.push(warning);
        return Ok(None);
    };
    let place = format!("`{}`", path.display());
    let known = assembly.pictures.iter().position(|picture| picture.place == place);
    let picture = known.unwrap_or_else(|| {
        assembly.pictures.push(Picture { source: Source::File(path), place });
        assembly.pictures.len() - 1
    });
    let wrapping = if is_clamped { Wrapping::ClampToEdge } else { Wrapping::Repeat };
    Ok(Some(Texture { picture: picture as u32, wrapping: [wrapping; 2] }))
}

/// The file name after the options, which begin with a hyphen and take words that are numbers, `on`, `off` or a channel;
/// and whether the texture is clamped.
fn without_options(text: &str) -> (&str, bool) {
    let mut rest = text.trim();
    let mut is_clamped = false;
    while rest.starts_with('-') {
        let (option, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        rest = after.trim_start();
        let is_value =
            |word: &str| word.parse::<f64>().is_ok() || ["on", "off", "r", "g", "b", "m", "l", "z"].contains(&word);
        while let Some(word) = rest.split_ascii_whitespace().next().filter(|word| is_value(word)) {
            is_clamped |= option == "-clamp" && word == "on";
            rest = rest[word.len()..].trim_start();
        }
    }
    (rest, is_clamped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_textures_may_follow_options_and_have_spaces() {
        assert_eq!(without_options("wood.png"), ("wood.png", false));
        assert_eq!(without_options("-s 1 1 1 -o 0 0 -clamp on old wood.png"), ("old wood.png", true));
        assert_eq!(without_options("-bm 0.5 -clamp off 7up.png"), ("7up.png", false));
        assert_eq!(without_options("-s 1"), ("", false));
    }
}
