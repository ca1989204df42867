from .autoencoder import (
    Autoencoder as Autoencoder,
    BasicBlock as BasicBlock,
    convolution as convolution,
    doubling as doubling,
    pad as pad,
)
from .input_maps import log_snr as log_snr
from .losses import (
    LossWeights as LossWeights,
    depth_guided_loss as depth_guided_loss,
    masked_mean as masked_mean,
    own as own,
    regression_loss as regression_loss,
    scale_invariant_loss as scale_invariant_loss,
    ssim_loss as ssim_loss,
)
from .network import (
    Draw as Draw,
    Needs as Needs,
    Network as Network,
    Prediction as Prediction,
    Settings as Settings,
    autocast as autocast,
)
from .predictor import (
    Unwrapper as Unwrapper,
    label_of as label_of,
    load_unwrapper as load_unwrapper,
)
from .registry import (
    NetworkName as NetworkName,
    build_network as build_network,
    network_class as network_class,
)
from .sizes import predict_thinned as predict_thinned, trained_size as trained_size
from .toffusionnet import true_wraps as true_wraps
from .tofregnet import TofRegNet as TofRegNet
from .tofsegnet import (
    TofSegNet as TofSegNet,
    class_depth_m as class_depth_m,
    wrap_classes as wrap_classes,
)
from .weight_files import WeightsLabel as WeightsLabel, save_weights as save_weights
