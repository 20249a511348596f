"""Small random graphs and GTSAM's answers to them: the fixtures of the optimizer crate.

usage: make_fixtures.py FOLDER, with gtsam 4.3.0 and numpy installed.
"""
import gtsam, os, random, math, sys
out = sys.argv[1]
def g2o(path, lines): open(path,'w').write("\n".join(lines)+"\n")
def read(path, space):
    """GTSAM's reader does not know FIX."""
    bare = path + ".bare"
    g2o(bare, [l for l in open(path).read().splitlines() if not l.startswith("FIX")])
    answer = gtsam.readG2o(bare, space)
    os.remove(bare)
    return answer
def f(x): return repr(float(x))
random.seed(20061)
n=40
# SE(2)
truth=[gtsam.Pose2(0,0,0)]
for k in range(1,n):
    truth.append(truth[-1].compose(gtsam.Pose2(1.0,0.05*math.sin(k),math.pi/2 if k%8==0 else 0.02)))
pairs=[(k,k+1) for k in range(n-1)]+[(a,b) for a in range(n) for b in range(a+3,n) if math.hypot(truth[a].x()-truth[b].x(),truth[a].y()-truth[b].y())<1.5][:30]
lines=[]; chain=[gtsam.Pose2(0,0,0)]; edges=[]
for a,b in pairs:
    s=[0.05,0.03,0.02]
    z=truth[a].between(truth[b]).compose(gtsam.Pose2(random.gauss(0,s[0]),random.gauss(0,s[1]),random.gauss(0,s[2])))
    i=[round(1/x**2,6) for x in s]
    edges.append("EDGE_SE2 %d %d %s %s %s %s 20.0 -5.0 %s 10.0 %s"%(a,b,f(z.x()),f(z.y()),f(z.theta()),f(i[0]),f(i[1]),f(i[2])))
    if b==a+1: chain.append(chain[-1].compose(z))
for k,p in enumerate(chain): lines.append("VERTEX_SE2 %d %s %s %s"%(k,f(p.x()),f(p.y()),f(p.theta())))
g2o(out+"/plane.g2o",lines+["FIX 0"]+edges)
graph,init=read(out+"/plane.g2o",False)
p=gtsam.LevenbergMarquardtParams(); p.setRelativeErrorTol(1e-14); p.setAbsoluteErrorTol(1e-14); p.setMaxIterations(100)
h=gtsam.NonlinearFactorGraph(graph); h.add(gtsam.NonlinearEqualityPose2(0,init.atPose2(0)))
r=gtsam.LevenbergMarquardtOptimizer(h,init,p).optimize()
res=["chi2 start %s end %s"%(f(2*graph.error(init)),f(2*graph.error(r)))]
for k in (1,13,27,39):
    q=r.atPose2(k); res.append("pose %d %s %s %s"%(k,f(q.x()),f(q.y()),f(q.theta())))
hp=gtsam.NonlinearFactorGraph(graph); hp.add(gtsam.PriorFactorPose2(0,init.atPose2(0),gtsam.noiseModel.Diagonal.Sigmas([1e-7]*3)))
import numpy as np
H=hp.linearize(r).hessian()[0]
S=np.linalg.inv(H)
for k in (13,39):
    res.append("covariance %d %d "%(k,k)+" ".join(f(x) for x in S[3*k:3*k+3,3*k:3*k+3].flatten()))
res.append("covariance 13 39 "+" ".join(f(x) for x in S[39:42,117:120].flatten()))
g2o(out+"/plane.gtsam.txt",res)
# SE(3)
n=25
truth=[gtsam.Pose3()]
for k in range(1,n):
    truth.append(truth[-1].compose(gtsam.Pose3(gtsam.Rot3.RzRyRx(0.1*math.sin(k),0.05,0.5),[1.0,0.1,0.2])))
pairs=[(k,k+1) for k in range(n-1)]+[(k,k+11) for k in range(0,n-11,3)]
chain=[gtsam.Pose3()]; edges=[]; 
def wr(z):
    t=z.translation(); q=z.rotation().toQuaternion()
    return "%s %s %s %s %s %s %s"%(f(t[0]),f(t[1]),f(t[2]),f(q.x()),f(q.y()),f(q.z()),f(q.w()))
for a,b in pairs:
    xi=[random.gauss(0,0.02) for _ in range(3)]+[random.gauss(0,0.05) for _ in range(3)]
    z=truth[a].between(truth[b]).compose(gtsam.Pose3.Expmap(xi))
    info=[]
    for i in range(6):
        for j in range(i,6):
            info.append((400.0 if i<3 else 2500.0) if i==j else (5.0 if j==i+1 else 0.0))
    edges.append("EDGE_SE3:QUAT %d %d %s %s"%(a,b,wr(z)," ".join(f(x) for x in info)))
    if b==a+1: chain.append(chain[-1].compose(z))
g2o(out+"/space.g2o",["VERTEX_SE3:QUAT %d %s"%(k,wr(q)) for k,q in enumerate(chain)]+["FIX 0"]+edges)
graph,init=read(out+"/space.g2o",True)
h=gtsam.NonlinearFactorGraph(graph); h.add(gtsam.NonlinearEqualityPose3(0,init.atPose3(0)))
r=gtsam.LevenbergMarquardtOptimizer(h,init,p).optimize()
res=["chi2 start %s end %s"%(f(2*graph.error(init)),f(2*graph.error(r)))]
for k in (1,9,24): res.append("pose %d %s"%(k,wr(r.atPose3(k))))
g2o(out+"/space.gtsam.txt",res)
