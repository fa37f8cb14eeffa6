"""The loop over epochs and batches, on one device or several (chapter 8)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim.lr_scheduler import OneCycleLR, ReduceLROnPlateau
from torch.utils.data import DataLoader
from tqdm.std import tqdm

from fpputil.dataset.synthfringe import SynthFringe
from fpputil.learning.config import TrainingConfig
from fpputil.learning.devices import Processes, forward, hardware
from fpputil.learning.loaders import Batches
from fpputil.learning.log import write_log
from fpputil.learning.run import Run
from fpputil.learning.weights import Trained, save_weights
from fpputil.networks.geometry import Geometry
from fpputil.networks.methods import Method
from fpputil.signals import stopping

WEIGHTS = "weights.safetensors"


@dataclass(eq=False)
class Trainer:
    """A run and all that it works with; `fit` puts it together."""

    method: Method
    settings: TrainingConfig
    geometry: Geometry
    where: Processes
    precision: str
    run: Run
    out: Path | None
    about: dict
    data: SynthFringe
    batches: Batches
    progress: bool

    def train(self, training: DataLoader, validation: DataLoader) -> None:
        """Epochs until the last, or until patience ends."""
        run, settings, batches = self.run, self.settings, self.batches
        network = run.network
        if self.where.size > 1:
            network = DistributedDataParallel(network)
        every = len(batches) * min(settings.batch, batches.number)
        done = run.step * every // len(batches)  # of an epoch that was stopped
        with tqdm(
            total=settings.epochs * every, initial=len(run.history) * every + done, unit="image",
            disable=not (self.progress and self.where.rank == 0), smoothing=0.05,
        ) as bar, stopping() as stopped:  # fmt: skip
            if not (run.history or run.step):
                self._save()  # a folder that cannot be written to shows now, not after an epoch
            while len(run.history) < settings.epochs and not self._patience_ended():
                self.data.set_epoch(len(run.history))
                batches.epoch, batches.start = len(run.history), run.step
                self._epoch(network, training, bar, stopped)
                self._finish_epoch(self._validate(validation), every)
                bar.set_postfix(self._shown())

    def _patience_ended(self) -> bool:
        return 0 < self.settings.early_stopping <= self.run.waited

    def _epoch(self, network, loader, bar, stopped) -> None:
        run, start = self.run, time.perf_counter()
        before = run.seconds
        run.network.train()
        for batch in loader:
            batch = {k: v.to(self.where.device, non_blocking=True) for k, v in batch.items()}
            # seed, epoch, batch and process alone decide what dropout drops
            key = (self.settings.seed, len(run.history), run.step, self.where.rank)
            torch.manual_seed(int(np.random.SeedSequence(key).generate_state(1)[0]))
            self._learn(network, batch)
            run.step += 1
            run.seconds = before + time.perf_counter() - start
            bar.update(len(batch["index"]) * self.where.size)
            bar.set_postfix(self._shown(), refresh=False)
            if self.where.total(float(bool(stopped)))[0]:
                self._save()
                raise KeyboardInterrupt

    def _learn(self, network, batch: dict) -> None:
        """One step of the optimiser."""
        run = self.run
        outputs = self._forward(network, batch)
        losses = {k: v.mean() for k, v in self.method.losses(outputs, batch, self.geometry).items()}
        if not torch.isfinite(losses["total"]):
            raise FloatingPointError(
                f"the loss is {losses['total'].item()} in epoch {len(run.history) + 1}, batch "
                f"{run.step + 1}; a lower learning rate may help, in a run of its own"
            )
        run.optimiser.zero_grad(set_to_none=True)
        losses["total"].backward()
        nn.utils.clip_grad_norm_(run.network.parameters(), self.settings.max_grad_norm)
        run.optimiser.step()
        if isinstance(run.schedule, OneCycleLR):
            run.schedule.step()
        for k, v in losses.items():
            run.sums[k] = run.sums.get(k, 0.0) + v.item()

    def _forward(self, network, batch: dict):
        return forward(network, self.method.inputs(batch["frames"], self.geometry), self.precision)

    @torch.no_grad()
    def _validate(self, loader) -> dict[str, float]:
        """Errors of the absolute phase over all pixels of the validation views."""
        self.run.network.eval()
        number = total = square = wrong = 0.0
        for batch in loader:
            batch = {k: v.to(self.where.device) for k, v in batch.items()}
            outputs = self._forward(self.run.network, batch)
            Phi = self.method.absolute_phase(outputs, self.geometry)
            e = (Phi - batch["Phi"])[batch["mask"]].abs().double()
            number += len(e)
            total, square = total + e.sum().item(), square + (e**2).sum().item()
            wrong += (~(e <= math.pi)).sum().item()  # no phase is no right order
        number, total, square, wrong = self.where.total(number, total, square, wrong)
        if not number:
            raise ValueError("the validation views have empty masks; nothing to measure on")
        return {
            "validation_mae": total / number,
            "validation_rmse": math.sqrt(square / number),
            "validation_order_errors": wrong / number,
        }

    def _finish_epoch(self, measured: dict[str, float], images: int) -> None:
        run = self.run
        if not math.isfinite(measured["validation_mae"]):
            raise FloatingPointError(
                f"the network answers with {measured['validation_mae']} after epoch "
                f"{len(run.history) + 1}; a lower learning rate may help, in a run of its own"
            )
        means = {k: s / run.step for k, s in self._shared_sums().items()}
        rate = run.optimiser.param_groups[0]["lr"]
        if isinstance(run.schedule, ReduceLROnPlateau):
            run.schedule.step(measured["validation_mae"])
        better = measured["validation_mae"] < run.best
        run.history.append(
            {
                "epoch": len(run.history) + 1,
                "images": images * (len(run.history) + 1),
                "learning_rate": rate,
                **means,
                **measured,
                "seconds": run.seconds,
                "images_a_second": images / run.seconds,
            }
        )
        run.step, run.sums, run.seconds = 0, {}, 0.0
        if self.out is not None and self.where.rank == 0:
            if better:
                save_weights(self.out / WEIGHTS, self.trained())
        self._save()
        if self.out is not None and self.where.rank == 0:
            write_log(self.out, run.history)

    def _shared_sums(self) -> dict[str, float]:
        """Sums of the losses so far, averaged over the processes."""
        names = sorted(self.run.sums)
        sums = self.where.total(*(self.run.sums[k] for k in names))
        return {k: s / self.where.size for k, s in zip(names, sums, strict=True)}

    def _save(self) -> None:
        """Checkpoint, by the first process, of what all hold."""
        self.run.sums = self._shared_sums()
        if self.out is not None and self.where.rank == 0:
            self.run.save(self.out, self.about)

    def _shown(self) -> dict[str, str]:
        run = self.run
        shown = {"loss": f"{run.sums['total'] / run.step:.3f}"} if run.step else {}
        if run.history:
            shown["validation MAE"] = f"{run.history[-1]['validation_mae']:.3f}"
        return shown

    def trained(self) -> Trained:
        """The network as it is now, with what one needs to use it."""
        camera, history = self.geometry.system.camera, self.run.history
        metadata = {
            "pitches": self.geometry.pitches._asdict(),
            "camera": [camera.height, camera.width],
            "extremes": list(self.data.extremes),
            "data": self.about["data"],
            "training": {
                **{k: self.about[k] for k in ("settings", "precision", "start")},
                "epochs": len(history),
                "images": history[-1]["images"] if history else 0,
                "seconds": round(sum(row["seconds"] for row in history), 1),
                "validation_mae": history[-1]["validation_mae"] if history else None,
                "hardware": hardware(self.where.device) | {"processes": self.where.size},
            },
        }
        return Trained(self.method, self.run.network.eval(), metadata)
