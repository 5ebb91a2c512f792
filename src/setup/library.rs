//! Checks that a file is ONNX Runtime, and its version. This is done before `ort` loads the file, so that a wrong file
//! leads to an error message.

use std::ffi::{CStr, c_char, c_void};
use std::mem::ManuallyDrop;
use std::path::Path;

use super::catalog::OLDEST_ONNXRUNTIME;
use super::confined::confined;
use super::error::{SetupError, platform};

/// The head of ONNX Runtime's C interface, which has been stable since its first release (`onnxruntime_c_api.h`).
#[repr(C)]
struct OrtApiBase {
    get_api: unsafe extern "C" fn(u32) -> *const c_void,
    get_version_string: unsafe extern "C" fn() -> *const c_char,
}

/// Loads the library at `path` and returns its version, such as `1.31.1`. `given_by` names the flag or variable in
/// messages.
///
/// # Errors
/// If it cannot be loaded, is not ONNX Runtime, or is older than [`OLDEST_ONNXRUNTIME`].
pub fn version(path: &Path, given_by: &'static str) -> Result<String, SetupError> {
    confined(|| version_here(path, given_by))
}

fn version_here(path: &Path, given_by: &'static str) -> Result<String, SetupError> {
    let not_onnxruntime = || SetupError::NotOnnxRuntime { given_by, path: path.to_owned() };
    // dlopen would search the system for a bare name; this must be the file that was checked.
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    // SAFETY: loading runs the library's initialisers; the user chose this file to be loaded as ONNX Runtime. It stays
    // loaded, because ONNX Runtime does not promise to survive being unloaded.
    let library = ManuallyDrop::new(unsafe { libloading::Library::new(&absolute) }.map_err(|error| {
        let reason = std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string);
        SetupError::NotALibrary { given_by, path: path.to_owned(), reason, platform: platform() }
    })?);
    // SAFETY: this is the documented signature of the only symbol that every ONNX Runtime exports.
    let api_base = unsafe { library.get::<unsafe extern "C" fn() -> *const OrtApiBase>(b"OrtGetApiBase\0") }
        .map_err(|_| not_onnxruntime())?;
    // SAFETY: as above; both pointers are static data of the library, which is never unloaded.
    let version = unsafe {
        let base = api_base().as_ref().ok_or_else(not_onnxruntime)?;
        CStr::from_ptr((base.get_version_string)()).to_string_lossy().into_owned()
    };
    if is_new_enough(&version) {
        Ok(version)
    } else {
        Err(SetupError::TooOld { given_by, path: path.to_owned(), version })
    }
}

/// True if `version` (`major.minor...`) is at least [`OLDEST_ONNXRUNTIME`]; false if it cannot be parsed.
fn is_new_enough(version: &str) -> bool {
    let mut numbers = version.split('.').map(|part| part.parse::<u32>().ok());
    match (numbers.next().flatten(), numbers.next().flatten()) {
        (Some(major), Some(minor)) => (major, minor) >= OLDEST_ONNXRUNTIME,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::is_new_enough;

    #[test]
    fn versions_are_compared_as_numbers() {
        assert!(is_new_enough("1.20.0"));
        assert!(is_new_enough("1.31.1"));
        assert!(is_new_enough("2.0.0"));
        assert!(!is_new_enough("1.9.1"), "9 is older than 20");
        assert!(!is_new_enough("1.19.2"));
        assert!(!is_new_enough("nightly"));
    }
}
