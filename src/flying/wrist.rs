//! The wearer's panel in a flight: what it is told, and what comes of what is asked for there.

use std::time::Duration;

use anyhow::Result;
use toml::Value;

use super::Flying;
use crate::address::Address;
use crate::input::Input;
use crate::panels::wrist::{Choices, Gauges, WristWish};
use crate::pilot::{MotionSettings, Pilot};
use crate::settings::Settings;
use crate::viewer::Viewer;

impl Flying<'_> {
    /// What the wearer's hands want in a frame of `dt`, once the panel has had its share of what they do.
    ///
    /// # Errors
    /// Session or device are lost.
    pub fn hands(&mut self, viewer: &mut Viewer, flown: Duration, dt: Duration) -> Result<Input> {
        if self.wrist.is_shown() {
            let speed = self.helm.pilot().map(Pilot::speed);
            let gauges = Gauges { depth: self.standpoint(flown).depth, speed };
            self.wrist.know(gauges, self.choices(), &self.world);
        }
        let settings = self.helm.controllers.settings;
        self.wrist.tend(viewer, &settings, dt)?;
        self.helm.controllers.occupied = self.wrist.occupied();
        let mut input = self.helm.hands(viewer, dt);
        if self.wrist.scrolls() {
            (input.look, input.turn, input.travel.y) = Default::default();
        }
        while let Some(wish) = self.wrist.wish() {
            self.grant(wish, &mut input, flown);
        }
        Ok(input)
    }

    /// What the panel shows as chosen.
    pub fn choices(&self) -> Choices {
        let (motion, settings) = (&self.helm.motion, &self.helm.controllers.settings);
        Choices {
            speed: self.helm.pilot().map_or(motion.speed, |pilot| pilot.settings().speed),
            comfort_m: motion.comfort_m,
            vignette: self.comfort.settings.vignette,
            snap_turn: settings.snap_turn,
            fly_by_head: settings.fly_by_head,
            standing: settings.standing,
            panel: settings.panel,
        }
    }

    /// Has it like this from now on.
    pub fn choose(&mut self, choices: &Choices) {
        let Choices { speed, comfort_m, vignette, snap_turn, fly_by_head, standing, panel } = *choices;
        self.helm.set_speed(speed);
        let motion = MotionSettings { comfort_m, ..self.helm.motion };
        self.helm.set(&motion);
        self.comfort.settings.vignette = vignette;
        let settings = &mut self.helm.controllers.settings;
        (settings.snap_turn, settings.fly_by_head) = (snap_turn, fly_by_head);
        (settings.standing, settings.panel) = (standing, panel);
    }

    /// Other settings are in force, which `differ` by these names from those before: what was chosen on the panel stays but
    /// for these.
    pub fn heed(&mut self, chosen: &Choices, set: &Settings, differ: &[String]) {
        let differs = |path: &str| differ.iter().any(|differing| differing == path);
        let Settings { motion, comfort, controllers, .. } = set;
        self.choose(&Choices {
            speed: if differs("motion.speed") { motion.speed } else { chosen.speed },
            comfort_m: if differs("motion.comfort_m") { motion.comfort_m } else { chosen.comfort_m },
            vignette: if differs("comfort.vignette") { comfort.vignette } else { chosen.vignette },
            snap_turn: if differs("controllers.snap_turn") {
                controllers.snap_turn
            } else {
                chosen.snap_turn
            },
            fly_by_head: if differs("controllers.fly_by_head") {
                controllers.fly_by_head
            } else {
                chosen.fly_by_head
            },
            standing: if differs("controllers.standing") { controllers.standing } else { chosen.standing },
            panel: if differs("controllers.panel") { controllers.panel } else { chosen.panel },
        });
    }

    /// Writes what was chosen into settings that are in force.
    pub fn tell(&self, set: &mut Settings) {
        let Choices { comfort_m, vignette, snap_turn, fly_by_head, standing, panel, .. } = self.choices();
        // The speed that is set, and not what the wheel has made of it.
        (set.motion.speed, set.motion.comfort_m) = (self.helm.motion.speed, comfort_m);
        set.comfort.vignette = vignette;
        let controllers = &mut set.controllers;
        (controllers.snap_turn, controllers.fly_by_head) = (snap_turn, fly_by_head);
        (controllers.standing, controllers.panel) = (standing, panel);
    }

    fn grant(&mut self, wish: WristWish, input: &mut Input, flown: Duration) {
        match wish {
            WristWish::Choose { choices, settled } => {
                let before = self.kept.unwrap_or_else(|| self.choices());
                self.choose(&choices);
                // A slider on its way is not kept at each step.
                self.kept = (!settled).then_some(before);
                if settled {
                    self.wrist.shelf.save(changes(&before, &choices));
                }
            }
            WristWish::Restart => input.restart = true,
            WristWish::Level => input.level_up = true,
            WristWish::Recentre => input.recentre = true,
            WristWish::Mark => {
                let world = self.world.clone();
                let standpoint = self.standpoint(flown);
                let name = format!("{}-{:.0}", world.name, standpoint.depth);
                let address = Address::of(&world, &standpoint);
                self.wrist.shelf.mark(name, address);
            }
            WristWish::Go(name) => self.wrist.shelf.go(name, self.world.clone()),
            WristWish::World(name) => self.wrist.shelf.enter(name, self.world.clone()),
            WristWish::Close => self.wrist.close(),
        }
    }
}

/// The settings in which two choices differ, with the values of the second.
pub fn changes(before: &Choices, now: &Choices) -> Vec<(&'static str, Value)> {
    let all = |choices: &Choices| {
        let Choices { speed, comfort_m, vignette, snap_turn, fly_by_head, standing, panel } = *choices;
        // Nobody reads more digits than these in a file.
        let rounded = |value: f64| Value::Float((value * 1000.0).round() / 1000.0);
        [
            ("motion.speed", rounded(speed)),
            ("motion.comfort_m", rounded(comfort_m)),
            ("comfort.vignette", Value::Boolean(vignette)),
            ("controllers.snap_turn", rounded(f64::from(snap_turn))),
            ("controllers.fly_by_head", Value::Boolean(fly_by_head)),
            ("controllers.standing", Value::Boolean(standing)),
            ("controllers.panel", Value::String(panel.name().to_owned())),
        ]
    };
    let pairs = all(before).into_iter().zip(all(now));
    pairs.filter(|(before, now)| before != now).map(|(_, now)| now).collect()
}
