"""Tiny models of transformers with random weights, in folders as on the hub; nothing is downloaded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

NAMES = ("wall", "floor", "chair", "lamp", "table")
SWIN: dict[str, Any] = {
    "image_size": 32,
    "embed_dim": 8,
    "depths": [1, 1, 1, 1],
    "num_heads": [1, 1, 2, 2],
    "window_size": 4,
    "out_features": ["stage1", "stage2", "stage3", "stage4"],
}
VIT: dict[str, Any] = {
    "image_size": 32,
    "patch_size": 8,
    "hidden_size": 16,
    "num_hidden_layers": 4,
    "num_attention_heads": 2,
    "intermediate_size": 24,
}


def labels() -> dict[str, Any]:
    """The settings of the classes."""
    return {"num_labels": len(NAMES), "id2label": dict(enumerate(NAMES))}


def segformer() -> tuple[Any, Any]:
    from transformers import SegformerConfig, SegformerForSemanticSegmentation
    from transformers.models.segformer.image_processing_pil_segformer import SegformerImageProcessorPil

    config = SegformerConfig(
        hidden_sizes=[8, 16, 24, 32], depths=[1, 1, 1, 1], num_attention_heads=[1, 1, 2, 2], decoder_hidden_size=16, **labels()
    )  # fmt: skip
    return SegformerForSemanticSegmentation(config), SegformerImageProcessorPil(size={"height": 32, "width": 48})


def upernet() -> tuple[Any, Any]:
    from transformers import ConvNextConfig, UperNetConfig, UperNetForSemanticSegmentation
    from transformers.models.segformer.image_processing_pil_segformer import SegformerImageProcessorPil

    stages = ["stage1", "stage2", "stage3", "stage4"]
    backbone = ConvNextConfig(hidden_sizes=[8, 12, 16, 24], depths=[1, 1, 1, 1], out_features=stages)
    config = UperNetConfig(
        backbone_config=backbone, hidden_size=16, auxiliary_in_channels=16, auxiliary_channels=8, pool_scales=[1, 2], **labels()
    )  # fmt: skip
    return UperNetForSemanticSegmentation(config), SegformerImageProcessorPil(size={"height": 32, "width": 48})


def dpt() -> tuple[Any, Any]:
    from transformers import DPTConfig, DPTForSemanticSegmentation
    from transformers.models.dpt.image_processing_pil_dpt import DPTImageProcessorPil

    config = DPTConfig(
        neck_hidden_sizes=[8, 8, 8, 8], fusion_hidden_size=8, backbone_out_indices=[0, 1, 2, 3], use_auxiliary_head=False,
        **VIT, **labels(),
    )  # fmt: skip
    return DPTForSemanticSegmentation(config), DPTImageProcessorPil(size={"height": 32, "width": 32})


def beit() -> tuple[Any, Any]:
    from transformers import BeitConfig, BeitForSemanticSegmentation
    from transformers.models.beit.image_processing_pil_beit import BeitImageProcessorPil

    config = BeitConfig(out_indices=[1, 2, 3, 4], use_auxiliary_head=False, pool_scales=[1, 2], **VIT, **labels())
    return BeitForSemanticSegmentation(config), BeitImageProcessorPil(size={"height": 32, "width": 32})


def maskformer() -> tuple[Any, Any]:
    from transformers import DetrConfig, MaskFormerConfig, MaskFormerForInstanceSegmentation, SwinConfig
    from transformers.models.maskformer.image_processing_pil_maskformer import MaskFormerImageProcessorPil

    decoder = DetrConfig(
        d_model=16, encoder_layers=1, decoder_layers=1, encoder_attention_heads=2, decoder_attention_heads=2, encoder_ffn_dim=16,
        decoder_ffn_dim=16, num_queries=6,
    )  # fmt: skip
    config = MaskFormerConfig(
        backbone_config=SwinConfig(**SWIN),
        decoder_config=decoder,
        fpn_feature_size=32,
        mask_feature_size=32,
        **labels(),
    )
    return MaskFormerForInstanceSegmentation(config), MaskFormerImageProcessorPil(size={"height": 32, "width": 64})


def mask2former() -> tuple[Any, Any]:
    from transformers import Mask2FormerConfig, Mask2FormerForUniversalSegmentation, SwinConfig
    from transformers.models.mask2former.image_processing_pil_mask2former import Mask2FormerImageProcessorPil

    config = Mask2FormerConfig(
        backbone_config=SwinConfig(**SWIN), feature_size=32, mask_feature_size=32, hidden_dim=32, encoder_feedforward_dim=16,
        encoder_layers=1, decoder_layers=2, num_attention_heads=2, dim_feedforward=16, num_queries=6, **labels(),
    )  # fmt: skip
    return Mask2FormerForUniversalSegmentation(config), Mask2FormerImageProcessorPil(size={"height": 32, "width": 64})


def tokenizer() -> Any:
    """A tokenizer of single letters, of at most 24 of them."""
    from transformers import CLIPTokenizer

    letters = "abcdefghijklmnopqrstuvwxyz"
    tokens = [*letters, *(f"{letter}</w>" for letter in letters), "<|startoftext|>", "<|endoftext|>"]
    return CLIPTokenizer(vocab={token: place for place, token in enumerate(tokens)}, merges=[], model_max_length=24)


def oneformer() -> tuple[Any, Any]:
    from transformers import OneFormerConfig, OneFormerForUniversalSegmentation, OneFormerProcessor, SwinConfig
    from transformers.models.oneformer.image_processing_pil_oneformer import OneFormerImageProcessorPil

    config = OneFormerConfig(
        backbone_config=SwinConfig(**SWIN), conv_dim=32, mask_dim=32, hidden_dim=32, encoder_feedforward_dim=16, encoder_layers=1,
        decoder_layers=2, num_attention_heads=2, dim_feedforward=16, num_queries=6, task_seq_len=24, text_encoder_width=16,
        text_encoder_context_length=24, text_encoder_num_layers=1, text_encoder_vocab_size=54, **labels(),
    )  # fmt: skip
    images = OneFormerImageProcessorPil(size={"height": 32, "width": 64})
    images.class_info_file = "ade20k_panoptic.json"  # published models name a file that training downloads
    processor = OneFormerProcessor(images, tokenizer(), max_seq_length=24, task_seq_length=24)
    return OneFormerForUniversalSegmentation(config), processor


def clipseg() -> tuple[Any, Any]:
    from transformers import CLIPSegConfig, CLIPSegForImageSegmentation, CLIPSegProcessor
    from transformers.models.vit.image_processing_pil_vit import ViTImageProcessorPil

    text = {
        "vocab_size": 54, "hidden_size": 16, "intermediate_size": 24, "num_hidden_layers": 2, "num_attention_heads": 2,
        "max_position_embeddings": 24, "pad_token_id": 53, "bos_token_id": 52, "eos_token_id": 53,
    }  # fmt: skip
    config = CLIPSegConfig(
        text_config=text, vision_config=VIT, projection_dim=16, extract_layers=[1, 2, 3], reduce_dim=8, decoder_num_attention_heads=2,
        decoder_intermediate_size=16,
    )  # fmt: skip
    images = ViTImageProcessorPil(
        size={"height": 32, "width": 32}, image_mean=[0.48, 0.46, 0.41], image_std=[0.23, 0.22, 0.23]
    )
    return CLIPSegForImageSegmentation(config), CLIPSegProcessor(images, tokenizer())


def dinov2() -> Any:
    """A tiny backbone with patches of 14 pixels, as Depth Anything has."""
    from transformers import Dinov2Config

    return Dinov2Config(
        hidden_size=12, num_hidden_layers=4, num_attention_heads=2, image_size=28, patch_size=14, reshape_hidden_states=False,
        out_indices=[1, 2, 3, 4], apply_layernorm=True,
    )  # fmt: skip


def anything(kind: str) -> dict[str, Any]:
    """The settings of a depth network of the Depth Anything family; `kind` is relative or metric."""
    return {
        "backbone_config": dinov2(), "reassemble_hidden_size": 12, "neck_hidden_sizes": [8, 8, 8, 8], "fusion_hidden_size": 8,
        "head_hidden_size": 4, "depth_estimation_type": kind, "max_depth": 20 if kind == "metric" else 1,
    }  # fmt: skip


def depth_anything(kind: str = "relative") -> tuple[Any, Any]:
    from transformers import DepthAnythingConfig, DepthAnythingForDepthEstimation
    from transformers.models.dpt.image_processing_pil_dpt import DPTImageProcessorPil

    images = DPTImageProcessorPil(size={"height": 28, "width": 28}, keep_aspect_ratio=True, ensure_multiple_of=14)
    return DepthAnythingForDepthEstimation(DepthAnythingConfig(**anything(kind))), images


def depth_anything_metric() -> tuple[Any, Any]:
    return depth_anything("metric")


def prompt_depth_anything() -> tuple[Any, Any]:
    from transformers import PromptDepthAnythingConfig, PromptDepthAnythingForDepthEstimation
    from transformers.models.prompt_depth_anything.image_processing_pil_prompt_depth_anything import (
        PromptDepthAnythingImageProcessorPil,
    )

    config = PromptDepthAnythingConfig(**anything("metric"))
    images = PromptDepthAnythingImageProcessorPil(
        size={"height": 28, "width": 28}, keep_aspect_ratio=True, ensure_multiple_of=14
    )
    return PromptDepthAnythingForDepthEstimation(config), images


def dpt_depth() -> tuple[Any, Any]:
    from transformers import DPTConfig, DPTForDepthEstimation
    from transformers.models.dpt.image_processing_pil_dpt import DPTImageProcessorPil

    config = DPTConfig(neck_hidden_sizes=[8, 8, 8, 8], fusion_hidden_size=8, backbone_out_indices=[0, 1, 2, 3], **VIT)
    return DPTForDepthEstimation(config), DPTImageProcessorPil(size={"height": 32, "width": 32})


def zoedepth() -> tuple[Any, Any]:
    from transformers import BeitConfig, ZoeDepthConfig, ZoeDepthForDepthEstimation
    from transformers.models.zoedepth.image_processing_pil_zoedepth import ZoeDepthImageProcessorPil

    backbone = BeitConfig(
        image_size=32, patch_size=16, hidden_size=12, num_hidden_layers=4, num_attention_heads=2, intermediate_size=24,
        use_relative_position_bias=True, reshape_hidden_states=False, out_features=["stage1", "stage2", "stage3", "stage4"],
    )  # fmt: skip
    config = ZoeDepthConfig(
        backbone_config=backbone, neck_hidden_sizes=[8, 8, 8, 8], fusion_hidden_size=8, bottleneck_features=8, num_relative_features=4,
        bin_embedding_dim=8, num_attractors=[4, 2, 2, 1],
        bin_configurations=[{"name": "nyu", "n_bins": 8, "min_depth": 0.001, "max_depth": 10.0}],
    )  # fmt: skip
    return ZoeDepthForDepthEstimation(config), ZoeDepthImageProcessorPil(size={"height": 32, "width": 32})


def depth_pro() -> tuple[Any, Any]:
    from transformers import DepthProConfig, DepthProForDepthEstimation, Dinov2Config
    from transformers.models.vit.image_processing_pil_vit import ViTImageProcessorPil

    backbone = {
        "model_type": "dinov2", "hidden_size": 8, "num_hidden_layers": 2, "num_attention_heads": 2, "image_size": 16, "patch_size": 4,
    }  # fmt: skip
    config = DepthProConfig(
        patch_size=16, fusion_hidden_size=8, intermediate_hook_ids=[1, 0], intermediate_feature_dims=[8, 8],
        scaled_images_ratios=[0.5, 1.0], scaled_images_overlap_ratios=[0.0, 0.2], scaled_images_feature_dims=[8, 8],
        use_fov_model=True, num_fov_head_layers=1,
        image_model_config=Dinov2Config(**backbone), patch_model_config=Dinov2Config(**backbone), fov_model_config=Dinov2Config(**backbone),
    )  # fmt: skip
    return DepthProForDepthEstimation(config), ViTImageProcessorPil(size={"height": 64, "width": 64})


MAKERS: dict[str, Callable[[], tuple[Any, Any]]] = {
    maker.__name__: maker for maker in (segformer, upernet, dpt, beit, maskformer, mask2former, oneformer, clipseg)
} | {
    maker.__name__: maker
    for maker in (depth_anything, depth_anything_metric, prompt_depth_anything, dpt_depth, zoedepth, depth_pro)
}


CONTRAST = {"segformer": 8, "upernet": 6, "dpt": 11}
"""What weights are multiplied with so that answers differ from pixel to pixel; 3 for other kinds."""


def write_model(folder: Path, kind: str) -> Any:
    """A folder with a model of a kind, whose answers differ from pixel to pixel; the model."""
    from transformers.utils import logging

    logging.disable_progress_bar()
    torch.manual_seed(7)
    model, processor = MAKERS[kind]()
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            if parameter.dim() > 1:
                parameter.mul_(CONTRAST.get(kind, 3))
            if "queries_embedder" in name:
                parameter.mul_(100)  # so that masks differ
    model.eval().save_pretrained(folder)
    processor.save_pretrained(folder)
    return model
