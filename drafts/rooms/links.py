import re,subprocess,collections,os
files=[f for f in subprocess.run(["git","ls-files"],capture_output=True,text=True).stdout.split() if f.endswith((".cpp",".hpp",".inc"))]
pub=collections.defaultdict(set); prv=collections.defaultdict(set)
for f in files:
    if f.startswith("tests/"): continue
    a=os.path.dirname(f)
    for l in open(f,errors="replace"):
        m=re.match(r'\s*#\s*include\s*"([^"]+)"',l)
        if m and "/" in m[1]:
            b=os.path.dirname(m[1])
            if a!=b: (pub if f.endswith(".hpp") else prv)[a].add(b)
for a in sorted(set(pub)|set(prv)): print(a,"PUBLIC",*sorted(pub[a]),"| PRIVATE",*sorted(prv[a]-pub[a]))
