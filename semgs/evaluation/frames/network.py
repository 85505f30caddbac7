"""A network as a method to evaluate."""

from __future__ import annotations

import pickle

import torch

from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.reconstruction.encode import Network, encode, now
from semgs.rendering.rendering import SEEN_ALPHA, likeliest


class NetworkMethod:
    """A network as a method: encode the contexts, draw the target.

    Args:
        network: in evaluation mode.
        device: to encode on.
        name: to call it by in tables.
    """

    def __init__(self, network: Network, device: str, name: str) -> None:
        self._network = network
        self._device = device
        self.name = name

    @torch.no_grad()
    def predict(self, inputs: Inputs) -> Prediction:
        """Encode, then render; each timed by itself, without the reading of files.

        Raises:
            NotEnoughMemoryError: it would not fit into memory.
        """
        if isinstance(self._network, torch.nn.Module):
            self._network.to(self._device)
        encoded = encode(self._network, inputs.contexts, device=None)  # what renders on a GPU finds it there
        start = now()
        rendering = encoded.encoding.render(inputs.camera)
        seconds = now() - start
        classes = None if rendering.semantics is None else likeliest(rendering.semantics[0]).cpu()
        return Prediction(
            labels=classes,
            image=rendering.images[0].float().clamp(0, 1).cpu(),
            depths=rendering.depths[0].float().cpu(),
            unseen=rendering.alphas[0].cpu() < SEEN_ALPHA,
            seconds_encode=encoded.seconds,
            seconds_render=seconds,
        )

    def __getstate__(self) -> dict[str, object]:
        """How it travels to a worker process: the network as bytes.

        As tensors, each of its hundreds would travel as an open file, of which a new process accepts 256.
        """
        return vars(self) | {"_network": pickle.dumps(self._network)}

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        held = state["_network"]
        assert isinstance(held, bytes)
        self._network = pickle.loads(held)
