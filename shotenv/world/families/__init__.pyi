from .settings import SETTINGS as SETTINGS
