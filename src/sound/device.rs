//! The system's audio device: a thread of its own opens it and keeps it open.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{FromSample, SampleFormat, SizedSample, Stream, StreamConfig};

use super::{Player, Voice, Wishes};

/// The default device, at play or being opened. Dropping it ends that.
pub(super) struct Device {
    /// None: it is to end. The thread waits for that.
    ends: Option<Sender<String>>,
    /// It ends with what there is to say of why.
    thread: Option<JoinHandle<Result<(), String>>>,
}

impl Device {
    /// Begins to open the default device for these wishes.
    ///
    /// # Errors
    /// There is no thread for it.
    pub(super) fn open(wishes: &Arc<Wishes>) -> Result<Device, String> {
        let (ends, ended) = channel();
        let (wishes, fails) = (Arc::clone(wishes), ends.clone());
        let play = move || play(&wishes, fails, &ended);
        let thread = std::thread::Builder::new().name("sound".to_owned()).spawn(play);
        let thread = thread.map_err(|error| error.to_string())?;
        Ok(Device { ends: Some(ends), thread: Some(thread) })
    }
}

impl Player for Device {
    fn plays(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    fn why(mut self: Box<Device>) -> String {
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(why))) => why,
            _ => "the audio device's thread has ended".to_owned(),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // A thread that has ended by itself hears nothing.
        if let Some(ends) = self.ends.take() {
            let _ = ends.send(String::new());
        }
        // A device that hangs is left to itself: nobody waits for it.
        if let Some(thread) = self.thread.take().filter(JoinHandle::is_finished) {
            let _ = thread.join();
        }
    }
}

/// Plays until the other end says so, or the device fails.
fn play(wishes: &Arc<Wishes>, fails: Sender<String>, ended: &Receiver<String>) -> Result<(), String> {
    // What ALSA has to say about devices that are not there is for the log, in one line, and not for the terminal.
    #[cfg(target_os = "linux")]
    let _hushed = alsa::Output::local_error_handler();
    let device = cpal::default_host().default_output_device().ok_or("there is no audio device")?;
    let stream = open(&device, wishes, fails).map_err(|error| error.to_string())?;
    stream.play().map_err(|error| error.to_string())?;
    tracing::info!("the tone is played");
    match ended.recv() {
        Ok(why) if !why.is_empty() => Err(why),
        _ => Ok(()),
    }
}

fn open(device: &cpal::Device, wishes: &Arc<Wishes>, fails: Sender<String>) -> Result<Stream, cpal::Error> {
    let config = device.default_output_config()?;
    let format = config.sample_format();
    let config = StreamConfig::from(config);
    match format {
        SampleFormat::I16 => stream::<i16>(device, config, wishes, fails),
        SampleFormat::I32 => stream::<i32>(device, config, wishes, fails),
        SampleFormat::U8 => stream::<u8>(device, config, wishes, fails),
        SampleFormat::U16 => stream::<u16>(device, config, wishes, fails),
        SampleFormat::F64 => stream::<f64>(device, config, wishes, fails),
        // The usual one, and what devices of rarer kinds commonly take, too; if not, it says so.
        _ => stream::<f32>(device, config, wishes, fails),
    }
}

fn stream<T: SizedSample + FromSample<f32>>(
    device: &cpal::Device,
    config: StreamConfig,
    wishes: &Arc<Wishes>,
    fails: Sender<String>,
) -> Result<Stream, cpal::Error> {
    let channels = usize::from(config.channels);
    let mut voice = Voice::new(Arc::clone(wishes), config.sample_rate as f32);
    let fill = move |samples: &mut [T], _: &cpal::OutputCallbackInfo| {
        voice.fill(samples, channels, T::from_sample);
    };
    let heed = move |error: cpal::Error| match error.kind() {
        // It goes on.
        cpal::ErrorKind::DeviceChanged | cpal::ErrorKind::Xrun | cpal::ErrorKind::RealtimeDenied => {
            tracing::debug!("sound: {error}");
        }
        _ => {
            let _ = fails.send(error.to_string());
        }
    };
    device.build_output_stream(config, fill, heed, None)
}
