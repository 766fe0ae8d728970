# A Kalman filter tuned to the Nile through libidentikal.so: nile.py LIBRARY MODEL RECORDING
import ctypes as c, csv, json, sys

class Recording(c.Structure):  # ik_recording of identikal.h
    _fields_ = [("time", c.c_void_p), ("y", c.POINTER(c.c_double)), ("u", c.c_void_p), ("rows", c.c_size_t),
                ("ny", c.c_size_t), ("nu", c.c_size_t), ("step", c.c_double), ("names", c.c_void_p), ("units", c.c_void_p)]

ik = c.CDLL(sys.argv[1])
ik.ik_result_json.restype = ik.ik_result_message.restype = c.c_char_p
flow = [float(row["volume"]) for row in csv.DictReader(open(sys.argv[3]))]
nile = Recording(y=(c.c_double * len(flow))(*flow), rows=len(flow), ny=1)
result = c.c_void_p()
code = ik.ik_run(b"tune", open(sys.argv[2], "rb").read(), c.byref(nile), c.c_size_t(1), None, c.c_size_t(0),
                 b'{"starts": 1}', None, c.byref(result))
print(ik.ik_result_message(result).decode())
for p in json.loads(ik.ik_result_json(result))["parameters"]:
    print(f"{p['name']} = {p['value']:.1f} +- {p['se']:.1f}")
ik.ik_result_free(result)
sys.exit(code)
