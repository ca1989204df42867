from .autoencoder import (
    Autoencoder as Autoencoder,
    BasicBlock as BasicBlock,
    class_depth_m as class_depth_m,
    convolution as convolution,
    doubling as doubling,
    pad as pad,
    wrap_classes as wrap_classes,
)
from .losses import (
    LossWeights as LossWeights,
    depth_guided_loss as depth_guided_loss,
    regression_loss as regression_loss,
    scale_invariant_loss as scale_invariant_loss,
    ssim_loss as ssim_loss,
)
from .network import (
    Needs as Needs,
    Network as Network,
    NetworkName as NetworkName,
    Prediction as Prediction,
    Settings as Settings,
    autocast as autocast,
)
from .phase_maps import compressed as compressed
from .predictor import Unwrapper as Unwrapper, load_unwrapper as load_unwrapper
from .registry import build as build, network_class as network_class
from .sizes import predicted as predicted
from .tofregnet import TofRegNet as TofRegNet
from .tofsegnet import TofSegNet as TofSegNet
from .weight_files import save_weights as save_weights
