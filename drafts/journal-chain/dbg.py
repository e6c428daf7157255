import sys; sys.path.insert(0,'tests/hil')
import latches as L, rig as r, tempfile, time
with tempfile.TemporaryDirectory() as f:
    rig=L.Rig('build/release/bin',f)
    rig.start()
    rig.order("estop open")
    s=rig.wait_for(lambda s: s["shaker"].get("fault"), 20); print(s["shaker"]["fault"], s["shaker"]["emergency_stop_open"], s["campaign"]["state"])
    rig.order("estop close")
    s=rig.wait_for(lambda s: s["shaker"].get("emergency_stop_open") is False, 20); print(s["shaker"]["fault"], s["campaign"]["state"])
    print(rig.daemon.end())
    s=rig.start(); print(s["shaker"]["fault"], s["campaign"]["state"], rig.latches())
    time.sleep(1); print(rig.daemon.text()[-3000:])
    rig.stop()
