"""Thesis, all chapters: campaigns: many seeded runs of a detection scheme, their tables, rates and intervals."""

from pumplib.campaign.executors import Pool, dask_pool, local_pool
from pumplib.campaign.progress import Console, Status
from pumplib.campaign.rates import (
    DetectionSize,
    Estimate,
    clopper_pearson,
    detection_size,
    quantile,
    rate,
    rate_table,
    wilson,
)
from pumplib.campaign.results import Rechecked, Result, read, recheck
from pumplib.campaign.run import Finished, run_campaign
from pumplib.campaign.schemes import SCHEMES, Scheme, load_scheme
from pumplib.campaign.spec import Campaign, Cell, campaign_from, campaigns, load_campaign
from pumplib.campaign.summary import summarise, write_summary

__all__ = [
    "SCHEMES",
    "Campaign",
    "Cell",
    "Console",
    "DetectionSize",
    "Estimate",
    "Finished",
    "Pool",
    "Rechecked",
    "Result",
    "Scheme",
    "Status",
    "campaign_from",
    "campaigns",
    "clopper_pearson",
    "dask_pool",
    "detection_size",
    "load_campaign",
    "load_scheme",
    "local_pool",
    "quantile",
    "rate",
    "rate_table",
    "read",
    "recheck",
    "run_campaign",
    "summarise",
    "wilson",
    "write_summary",
]
