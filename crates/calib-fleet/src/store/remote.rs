//! The stores themselves, through `object_store`.

use std::io::{Read as _, Write};
use std::path::Path;
use std::time::Duration;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{ObjectStore, ObjectStoreExt as _, RetryConfig, WriteMultipart};
use tokio::runtime::Runtime;

use super::error::{StoreError, StoreFault};

/// Bytes that are sent at a time: stores take parts of 5 MiB and more.
const PART: usize = 8 << 20;
/// Parts on their way at a time.
const PARTS: usize = 4;
/// For so long a request is repeated that a store did not answer, s.
const PATIENCE: Duration = Duration::from_secs(30);

/// A store, the folder in it, and what its requests run on.
#[derive(Debug)]
pub(super) struct Remote {
    store: Box<dyn ObjectStore>,
    prefix: Key,
    runtime: Runtime,
}

impl Remote {
    pub(super) fn open(url: &str) -> Result<Self, StoreError> {
        let failed = |why: String| StoreError::new(url, StoreFault::Address(why));
        let (scheme, rest) = url
            .split_once("://")
            .ok_or_else(|| failed("it has no `://`".to_owned()))?;
        let (store, prefix): (Box<dyn ObjectStore>, &str) = match scheme {
            "s3" => {
                let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
                let known = |c: u8| c.is_ascii_alphanumeric() || b".-_".contains(&c);
                if bucket.is_empty() || !bucket.bytes().all(known) {
                    return Err(failed(format!("no bucket can be called {bucket:?}")));
                }
                let store = bucket_of(bucket).map_err(|e| failed(said(&e)))?;
                (Box::new(store), prefix)
            }
            "file" => (Box::new(folder(rest).map_err(failed)?), ""),
            other => return Err(failed(format!("`{other}` is not known"))),
        };
        let prefix = Key::parse(prefix).map_err(|e| failed(e.to_string()))?;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(|e| StoreError::new(url, StoreFault::Unread(e.to_string())))?;
        Ok(Self {
            store,
            prefix,
            runtime,
        })
    }

    fn key(&self, name: &str) -> Key {
        self.prefix.clone().join(name)
    }

    pub(super) fn names(&self) -> Result<Vec<String>, StoreFault> {
        let prefix = (!self.prefix.as_ref().is_empty()).then_some(&self.prefix);
        let listed = self
            .runtime
            .block_on(self.store.list_with_delimiter(prefix))
            .map_err(|e| unread(&e))?;
        let names = listed
            .objects
            .iter()
            .filter_map(|object| object.location.filename());
        Ok(names.map(str::to_owned).collect())
    }

    pub(super) fn holds(&self, name: &str) -> Result<bool, StoreFault> {
        let head = self.runtime.block_on(self.store.head(&self.key(name)));
        match head {
            Ok(_) => Ok(true),
            // So does an object in a bucket that is not there answer.
            Err(object_store::Error::NotFound { .. }) => self.is_there().map(|()| false),
            Err(error) => Err(unread(&error)),
        }
    }

    /// Whether the store answers for what it holds here, be it nothing.
    fn is_there(&self) -> Result<(), StoreFault> {
        use futures_util::StreamExt as _;
        let mut all = self.store.list(Some(&self.prefix));
        match self.runtime.block_on(all.next()) {
            None | Some(Ok(_)) => Ok(()),
            Some(Err(error)) => Err(unread(&error)),
        }
    }

    pub(super) fn fetch(&self, name: &str, to: &mut dyn Write) -> Result<(), StoreFault> {
        use futures_util::StreamExt as _;
        let unwritten = |error: std::io::Error| StoreFault::Unread(error.to_string());
        self.runtime.block_on(async {
            let got = self.store.get(&self.key(name)).await;
            let mut stream = got.map_err(|e| unread(&e))?.into_stream();
            while let Some(piece) = stream.next().await {
                let piece = piece.map_err(|e| unread(&e))?;
                to.write_all(&piece).map_err(unwritten)?;
            }
            Ok(())
        })
    }

    pub(super) fn put(&self, from: &Path, name: &str) -> Result<(), StoreFault> {
        let unread = |error: std::io::Error| StoreFault::Unwritten(error.to_string());
        let mut file = calib_files::input::open(from).map_err(unread)?;
        let size = file.metadata().map_err(unread)?.len();
        let key = self.key(name);
        let piece = |file: &mut std::fs::File| -> Result<Vec<u8>, StoreFault> {
            let mut bytes = Vec::new();
            file.take(PART as u64)
                .read_to_end(&mut bytes)
                .map_err(unread)?;
            Ok(bytes)
        };
        self.runtime.block_on(async {
            if size <= PART as u64 {
                let bytes = piece(&mut file)?;
                let put = self.store.put(&key, bytes.into()).await;
                return put.map(drop).map_err(|e| unwritten(&e));
            }
            let upload = self.store.put_multipart(&key).await;
            let upload = upload.map_err(|e| unwritten(&e))?;
            let mut upload = WriteMultipart::new_with_chunk_size(upload, PART);
            loop {
                let bytes = piece(&mut file)?;
                if bytes.is_empty() {
                    break;
                }
                let room = upload.wait_for_capacity(PARTS).await;
                room.map_err(|e| unwritten(&e))?;
                upload.put(bytes.into());
            }
            upload.finish().await.map(drop).map_err(|e| unwritten(&e))
        })
    }
}

/// A bucket, as the environment says where and with which keys.
fn bucket_of(bucket: &str) -> Result<object_store::aws::AmazonS3, object_store::Error> {
    let retry = RetryConfig {
        retry_timeout: PATIENCE,
        ..RetryConfig::default()
    };
    let builder = AmazonS3Builder::from_env()
        .with_bucket_name(bucket)
        .with_retry(retry);
    let endpoint = builder.get_config_value(&AmazonS3ConfigKey::Endpoint);
    // Whoever writes http:// there means it.
    let plain = endpoint.is_some_and(|endpoint| endpoint.starts_with("http://"));
    match plain {
        true => builder.with_allow_http(true).build(),
        false => builder.build(),
    }
}

/// A folder of this machine, which is made where it is not there.
fn folder(path: &str) -> Result<LocalFileSystem, String> {
    if !path.starts_with('/') {
        return Err("a folder begins with `/`: `file:///data/shards`".to_owned());
    }
    calib_files::make_folder(Path::new(path)).map_err(|e| e.to_string())?;
    LocalFileSystem::new_with_prefix(path).map_err(|e| said(&e))
}

fn unread(error: &object_store::Error) -> StoreFault {
    fault(error, StoreFault::Unread)
}

fn unwritten(error: &object_store::Error) -> StoreFault {
    fault(error, StoreFault::Unwritten)
}

fn fault(error: &object_store::Error, other: fn(String) -> StoreFault) -> StoreFault {
    use object_store::Error;
    match error {
        Error::NotFound { .. } => StoreFault::Missing,
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
            StoreFault::Denied(said(error))
        }
        // Only the text of an answer to a list or to a query for keys has its status.
        error => match said(error) {
            text if text.contains("404 Not Found") => StoreFault::Missing,
            text if text.contains("403 Forbidden") => StoreFault::Denied(text),
            text => other(text),
        },
    }
}

/// The innermost reason on one line, without the document that a server sends with it.
fn said(error: &object_store::Error) -> String {
    let mut last: &dyn std::error::Error = error;
    while let Some(source) = last.source() {
        last = source;
    }
    let text = last.to_string();
    let text = text.split(": <?xml").next().unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
