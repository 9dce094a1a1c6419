# Makes welch.json: the independent numbers that tests/psd_scipy.rs compares with.
# Run with scipy (written with the version recorded in the file): python3 make_welch.py > welch.json
import json, numpy as np, scipy
from scipy.signal import welch
n, fs = 700, 50.0
i = np.arange(n)
# Written with integer arithmetic so that Rust can build the same samples: a Weyl sequence plus two lines.
x = ((i * 7919 + 13) % 1009) / 1009.0 - 0.37 + ((i * i) % 97) / 53.0
cases = []
for seg in (256, 255, 128, 700):
    f, p = welch(x, fs=fs, nperseg=seg)
    cases.append(dict(segment=seg, frequency=list(f), density=list(p)))
print(json.dumps(dict(origin="scipy.signal.welch, defaults", scipy=scipy.__version__, numpy=np.__version__,
                      rate_hz=fs, samples=n, cases=cases)))
