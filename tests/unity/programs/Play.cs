using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Net;
using System.Net.Sockets;
using System.Text;
using Gsac;
using UnityEngine;
using UnityEditor.AssetImporters;

/// <summary>Plays the package's scripts over the stubs of Unity and tells what they did.</summary>
public static class Play
{
    public static int Main(string[] args)
    {
        CultureInfo.DefaultThreadCurrentCulture = CultureInfo.CurrentCulture = new CultureInfo("de-DE"); // commas for points
        switch (args[0])
        {
            case "frame": Frame(args[1], args[2], args[3], args.Length > 4 ? args[4] : null); break;
            case "sort": Sort(args); break;
            case "pose": Pose(args[1], args[2], args[3]); break;
            case "allocations": Allocations.Print(typeof(GsacAvatar).Assembly, args); break;
            case "garbage": Garbage(args[1]); break;
            case "stream": Stream(args[1], int.Parse(args[2]), int.Parse(args[3])); break;
            case "messages": Messages(args[1], args[2], args[3]); break;
            case "benchmark": Benchmark(args[1], args[2]); break;
            case "import": Import(args[1]); break;
            case "levels": Levels(args[1]); break;
            case "heights": Heights(args); break;
            case "light": Light(args[1]); break;
            case "inspector": Inspector(args[1]); break;
            case "demo": Demo(args[1]); break;
            case "life": Life(args[1]); break;
            case "cast": Adopt.Cast(args[1]); break;
            case "load": Adopt.LoadAsync(args[1], args[2]); break;
            case "paint": Adopt.Paint(args[1], args[2], args[3]); break;
            case "look": Adopt.Look(args[1], args[2]); break;
            case "samples": AdoptSamples.Run(args[1], args[2]); break;
            case "self-check": Adopt.SelfCheck(args[1], args[2]); break;
            case "eye-check": Adopt.EyeCheck(args[1], args[2]); break;
            case "cameras": Drawing.Cameras(args[1]); break;
            case "zoom": Drawing.Zoom(args[1]); break;
            case "scene": PlayLight.Scene(args[1], args[2]); break;
            case "dressed": DrawOwn.Dressed(args[1]); break;
            case "picture": DrawOwn.Picture(args[1], args[2]); break;
            case "headset": DrawOwn.Headset(args[1], args[2]); break;
            case "rays": Touch.Rays(args[1], args[2], args[3], args[4]); break;
            case "colliders": Touch.Colliders(args[1], args[2]); break;
            case "addresses": Touch.Addresses(args); break;
            case "finish": Drawing.Finish(args[1]); break;
            case "crowd": Crowd.Print(args); break;
            case "crowds": Crowd.Count(args[1]); break;
            case "repeated": Drawing.Repeated(args[1]); break;
            case "swapped": Drawing.Swapped(args[1], args[2]); break;
            case "closed": Drawing.Closed(args[1]); break;
            case "freed": Drawing.Freed(args[1]); break;
            default: return Drive.Run(args);
        }
        return 0;
    }

    public static float[] Numbers(string path)
    {
        string[] words = File.ReadAllText(path).Split(new[] { ' ', '\n' }, StringSplitOptions.RemoveEmptyEntries);
        return Array.ConvertAll(words, w => float.Parse(w, CultureInfo.InvariantCulture));
    }

    static T[] Part<T>(T[] all, int from, int count)
    {
        var part = new T[count];
        Array.Copy(all, from, part, 0, count);
        return part;
    }

    /// <summary>numbers: 165 of SMPL-X's pose, 3 of transl, the weights.</summary>
    public static GsacAvatar Posed(string file, float[] numbers)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        avatar.SetSmplx(Part(numbers, 0, 3), Part(numbers, 3, 63), Part(numbers, 75, 45), Part(numbers, 120, 45), Part(numbers, 66, 3),
                        Part(numbers, 69, 3), Part(numbers, 72, 3));
        avatar.Pose.SetSmplxTransl(numbers[165], numbers[166], numbers[167]);
        for (int e = 0; e < avatar.Data.Expressions.Length; e++) avatar.SetExpression(avatar.Data.Expressions[e], numbers[168 + e]);
        avatar.SkipFade();
        return avatar;
    }

    /// <summary>One frame: every buffer, dispatch and draw, to be run on a GPU by the test. shape: what alone a clip of Unity's moves, to 0.6.</summary>
    static void Frame(string file, string numbers, string path, string shape)
    {
        GsacAvatar avatar = Posed(file, Numbers(numbers));
        if (shape != null)
        {
            avatar.ClearExpressions();
            var clip = new AnimationClip();
            clip.SetCurve("Body", typeof(SkinnedMeshRenderer), "blendShape." + shape, new AnimationCurve(new Keyframe(0, 0, 0, 100), new Keyframe(1, 100, 100, 0)));
            clip.SampleAnimation(avatar.gameObject, 0.6f);
        }
        avatar.transform.localPosition = new Vector3(0.4f, 0.1f, -0.7f);
        avatar.transform.localRotation = Quaternion.Euler(5, 40, -3);
        avatar.transform.localScale = new Vector3(1.2f, 1.2f, 1.2f);
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(1.5f, 1.6f, 2.5f), Quaternion.Euler(12, 215, 2));
        string[] names = { "GsacVertexCount", "GsacSplatCount", "GsacIndexBits", "GsacSortStage", "GsacSortShift", "GsacSortStrides" };
        string[] buffers = { "GsacRest", "GsacSkin", "GsacMoves", "GsacWeights", "GsacBones", "GsacPosed", "GsacCorners", "GsacLocal", "GsacSplats", "GsacKeys",
                             "GsacPairs", "GsacFirst", "GsacTurns" };
        using (var dump = new Dump(path))
        {
            var written = new HashSet<string>();
            var steps = new List<float>();
            GraphicsBuffer bent = null;
            Player.OnDispatch = (shader, kernel, groups) =>
            {
                steps.Add(kernel);
                steps.Add(groups);
                foreach (string name in names) steps.Add(Player.Value(shader, Shader.PropertyToID(name)).x);
                Vector4 range = Player.Value(shader, Shader.PropertyToID("GsacDepthRange")), row = Player.Value(shader, Shader.PropertyToID("GsacDepthRow"));
                steps.AddRange(new[] { range.x, range.y, row.x, row.y, row.z, row.w });
                foreach (string name in new[] { "GsacLightRed", "GsacLightGreen", "GsacLightBlue" })
                {
                    Vector4 light = Player.Value(shader, Shader.PropertyToID(name));
                    steps.AddRange(new[] { light.x, light.y, light.z, light.w });
                }
                foreach (string name in buffers)
                {
                    GraphicsBuffer buffer = Player.Buffer(shader, kernel, Shader.PropertyToID(name));
                    if (buffer != null && written.Add(name)) dump.Put(name, Player.Words(buffer));
                }
                GraphicsBuffer rest = Player.Buffer(shader, kernel, Shader.PropertyToID("GsacRest"));
                if (rest != null && bent != null) dump.Put("skins_bent", new[] { ReferenceEquals(rest, bent) ? 1 : 0 });
                bent = Player.Buffer(shader, kernel, Shader.PropertyToID("GsacBent")) ?? bent;
            };
            Player.OnDraw = (asked, indices, count) =>
            {
                MaterialPropertyBlock block = asked.matProps;
                var rows = new List<float>();
                foreach (string name in new[] { "GsacModel0", "GsacModel1", "GsacModel2", "GsacBlend" })
                {
                    Vector4 v = Player.Value(block, Shader.PropertyToID(name));
                    rows.AddRange(new[] { v.x, v.y, v.z, v.w });
                }
                rows.Add(Player.Value(block, Shader.PropertyToID("GsacIndexBits")).x);
                Bounds b = asked.worldBounds;
                rows.AddRange(new[] { b.center.x, b.center.y, b.center.z, b.size.x, b.size.y, b.size.z, count });
                dump.Put("draw", rows.ToArray());
                dump.Put("keeps_energy", new[] { Player.Value(block, Shader.PropertyToID("GsacKeepsEnergy")).x });
                dump.Put("GsacColours", Player.Words(Player.Buffer(block, Shader.PropertyToID("GsacColours"))));
                dump.Put("indices", Player.Words(indices));
                // right, up, ahead, place, as columns
                Matrix4x4 m = camera.transform.localToWorldMatrix;
                dump.Put("camera", new[] { m.m00, m.m01, m.m02, m.m03, m.m10, m.m11, m.m12, m.m13, m.m20, m.m21, m.m22, m.m23 });
            };
            Player.Frame(new[] { avatar.gameObject })();
            dump.Put("steps", steps.ToArray());
        }
    }

    /// <summary>The sort's dispatches for some numbers of gaussians.</summary>
    static void Sort(string[] counts)
    {
        for (int i = 1; i < counts.Length; i++)
        {
            var sort = new GsacSort(int.Parse(counts[i]));
            Console.WriteLine("keys " + sort.KeyCount + " " + sort.IndexBits);
            foreach (GsacSortStep s in sort.Steps) Console.WriteLine("Sort" + s.Kernel + " " + s.Stage + " " + s.Shift + " " + s.Strides + " " + s.Groups);
        }
    }

    /// <summary>Joint transforms and the weights that are drawn.</summary>
    static void Pose(string file, string numbers, string path)
    {
        GsacAvatar avatar = Posed(file, Numbers(numbers));
        Player.Frame(new[] { avatar.gameObject })();
        avatar.CollectWeights();
        using (var dump = new Dump(path))
        {
            var rows = new Vector4[avatar.Data.JointCount * 3];
            GsacSkeleton.Bones(avatar.Data, avatar.transform, avatar.Joints, rows);
            var flat = new List<float>();
            foreach (Vector4 r in rows) flat.AddRange(new[] { r.x, r.y, r.z, r.w });
            dump.Put("bones", flat.ToArray());
            dump.Put("weights", avatar.DrawnWeights);
            foreach (KeyValuePair<string, GsacClip> clip in avatar.Data.Clips)
            {
                var pose = new GsacPose(avatar.Data.JointCount);
                pose.Sample(clip.Value, 1.23f);
                dump.Put("clip." + clip.Key, pose.Rotation);
                dump.Put("transl." + clip.Key, pose.Transl);
            }
        }
    }

    /// <summary>Garbage collections while many frames go by, in every source, with a moving camera and live messages.</summary>
    static void Garbage(string file)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        Camera camera = Player.AddCamera("eye");
        Player.AddCamera("second eye").transform.SetPositionAndRotation(new Vector3(0, 1, 9), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        var reach = avatar.gameObject.AddComponent<GsacReach>();
        foreach (GsacEnd end in GsacLimb.Ends) reach.SetGoal(end, camera.transform);
        reach.Turn = true;
        Action frame = Player.Frame(new[] { avatar.gameObject });
        var message = new GsacPoseMessage(avatar.Data);
        var heard = new GsacLivePose(avatar.Data);
        byte[] osc = Bundle(Osc("/gsac/joint/left_knee", 0.1f, 0, 0), Osc("/gsac/expression/jawOpen", 0.25f), Osc("/other", 1));
        byte[] text = Encoding.UTF8.GetBytes("{\"joints\":{\"left_elbow\":[0.1,-1.25e-1,0]},\"expression\":{\"jawOpen\":0.5},\"other\":[1,{\"a\":\"b\"}]}");
        foreach (GsacSource source in new[] { GsacSource.Animator, GsacSource.Script, GsacSource.Clip })
        {
            avatar.Source = source;
            int understood = 0;
            for (int i = 0; i < 200; i++) frame();
            int before = GC.CollectionCount(0);
            draws = 0;
            for (int i = 0; i < 6000; i++)
            {
                camera.transform.SetPositionAndRotation(new Vector3(0, 1, 3 + i * 1e-4f), Quaternion.Euler(0, 180, 0));
                byte[] sent = i % 2 == 0 ? text : osc;
                if (message.Read(sent, sent.Length, heard) == GsacMessageFault.None) understood++;
                frame();
            }
            Console.WriteLine(source + " " + draws + " " + understood + " " + (GC.CollectionCount(0) - before));
        }
        // what this would show if a frame made one small object
        int first = GC.CollectionCount(0);
        for (int i = 0; i < 6000; i++) Kept = new object[4];
        Console.WriteLine("control " + (GC.CollectionCount(0) - first));
    }

    public static object Kept;

    /// <summary>The inspector's buttons and sliders on an imported prefab in edit mode, and a scene view that is turned.</summary>
    static void Inspector(string file)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        var avatar = ((GameObject)context.mainObject).GetComponent<GsacAvatar>();
        Player.SetPlaying(false);
        var inspector = new GsacAvatarEditor { target = avatar };
        int elbow = avatar.Data.Joint("left_elbow"), shoulder = avatar.Data.Joint("left_shoulder");
        Player.Pressed = "A-pose";
        inspector.OnInspectorGUI();
        Player.Pressed = null;
        Say("shoulder", avatar.Joints[shoulder].localRotation);
        Player.Slides["Joint"] = elbow;
        inspector.OnInspectorGUI();
        Player.Slides["y"] = 60;
        Player.Slides["weight"] = 0.75f;
        inspector.OnInspectorGUI();
        Say("shoulder", avatar.Joints[shoulder].localRotation);
        Say("elbow", avatar.Joints[elbow].localRotation);
        Console.WriteLine("weight " + avatar.Weights[0].ToString(CultureInfo.InvariantCulture));
        var empty = new GameObject("empty").AddComponent<GsacAvatar>();
        new GsacAvatarEditor { target = empty }.OnInspectorGUI();

        var eye = new GameObject("scene view").AddComponent<Camera>();
        eye.transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        eye.Render();
        avatar.enabled = false;
        Player.Call(avatar, "OnDisable");
        eye.Render();
        Console.WriteLine("draws " + draws);
    }

    /// <summary>The demo scene as its file describes it, opened and played; the user presses buttons, drags and turns the wheel.</summary>
    static void Demo(string file)
    {
        Camera eye = Player.AddCamera("Main Camera");
        var person = new GameObject("Avatar");
        var avatar = person.AddComponent<GsacAvatar>();
        Player.SetField(avatar, "bytes", Player.Text(File.ReadAllBytes(file)));
        var holder = new GameObject("Demo");
        var demo = holder.AddComponent<GsacDemo>();
        Player.SetField(demo, "avatar", avatar);
        Player.SetField(demo, "eye", eye);
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        Player.Call(demo, "Start");
        Action frame = Player.Frame(new[] { person, holder });
        int shoulder = avatar.Data.Joint("right_shoulder");
        foreach (string button in new[] { null, "T-pose", "walk", "A-pose", "next expression" })
        {
            Player.Pressed = button;
            Player.Call(demo, "OnGUI");
            for (int i = 0; i < 60; i++) frame();
            Say(button ?? "start", avatar.Joints[shoulder].localRotation);
        }
        Player.Pressed = null;
        Vector3 before = eye.transform.position;
        Player.Mouse(EventType.MouseDrag, 500, 90, 0);
        Player.Call(demo, "OnGUI");
        Player.Mouse(EventType.ScrollWheel, 500, 0, -3);
        Player.Call(demo, "OnGUI");
        frame();
        Vector3 after = eye.transform.position;
        foreach (Vector3 p in new[] { before, after }) Console.WriteLine(string.Format(CultureInfo.InvariantCulture, "eye {0} {1} {2}", p.x, p.y, p.z));
        Console.WriteLine("draws " + draws);
    }

    static void Say(string what, Quaternion q)
    {
        Console.WriteLine(what + string.Format(CultureInfo.InvariantCulture, " {0} {1} {2} {3}", q.x, q.y, q.z, q.w));
    }

    /// <summary>Gaussians drawn near and far.</summary>
    static void Levels(string file)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        Camera camera = Player.AddCamera("eye");
        Player.OnDraw = (asked, indices, count) => Console.WriteLine(count / 6);
        foreach (float away in new[] { 3f, 12f, 30f, 300f, 3f, 8.5f, 9.2f, 8.5f, 7.9f })
        {
            camera.transform.SetPositionAndRotation(new Vector3(0, 1, away), Quaternion.Euler(0, 180, 0));
            Player.Frame(new[] { avatar.gameObject })();
        }
    }

    /// <summary>
    /// Gaussians drawn from words of m away, focal length over half the picture's height, the picture's px, and how: "one" eye,
    /// "flat" (no perspective), a headset whose "left" or "right" eye is that one and the other half as long, "hidden" (another layer).
    /// </summary>
    static void Heights(string[] args)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(args[1]), "person");
        avatar.TPose();
        avatar.SkipFade();
        Camera camera = Player.AddCamera("eye");
        int drawn = 0;
        Player.OnDraw = (asked, indices, count) => drawn = count / 6;
        for (int i = 2; i < args.Length; i += 4)
        {
            float focal = float.Parse(args[i + 1], CultureInfo.InvariantCulture);
            string how = args[i + 3];
            camera.transform.SetPositionAndRotation(new Vector3(0, 1, float.Parse(args[i], CultureInfo.InvariantCulture)), Quaternion.Euler(0, 180, 0));
            camera.projectionMatrix = how == "flat" ? new Matrix4x4 { m00 = focal, m11 = focal, m22 = -1e-4f, m33 = 1 }
                : new Matrix4x4 { m00 = focal, m11 = focal, m22 = -1, m23 = -0.02f, m32 = -1 };
            Player.SetPixelHeight(camera, int.Parse(args[i + 2]));
            Player.SetEyes(camera, how == "left" ? new[] { focal, focal / 2 } : how == "right" ? new[] { focal / 2, focal } : null);
            camera.cullingMask = how == "hidden" ? 0 : -1;
            drawn = 0;
            Player.Frame(new[] { avatar.gameObject })();
            Console.WriteLine(drawn);
        }
    }

    /// <summary>For each strength of the light, near and far: gaussians bound, and the three channels that bind them.</summary>
    static void Light(string file)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        Camera camera = Player.AddCamera("eye");
        Player.OnDispatch = (shader, kernel, groups) =>
        {
            if (kernel != shader.FindKernel("Bind")) return;
            string line = Player.Value(shader, Shader.PropertyToID("GsacSplatCount")).x.ToString(CultureInfo.InvariantCulture);
            foreach (string name in new[] { "GsacLightRed", "GsacLightGreen", "GsacLightBlue" })
            {
                Vector4 light = Player.Value(shader, Shader.PropertyToID(name));
                line += string.Format(CultureInfo.InvariantCulture, " {0} {1} {2} {3}", light.x, light.y, light.z, light.w);
            }
            Console.WriteLine(line);
        };
        var renderer = avatar.GetComponent<GsacRenderer>();
        foreach (float strength in new[] { renderer.ClipLight, 0.25f, 0, 7 })
        {
            renderer.ClipLight = strength;
            foreach (float away in new[] { 3f, 300f })
            {
                camera.transform.SetPositionAndRotation(new Vector3(0, 1, away), Quaternion.Euler(0, 180, 0));
                Player.Frame(new[] { avatar.gameObject })();
            }
        }
    }

    /// <summary>Datagrams through the real socket: how far the elbow and the jaw got, frame by frame.</summary>
    static void Stream(string file, int port, int other)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        var holder = avatar.gameObject;
        var stream = new GameObject("none").AddComponent<Probe>();
        stream.Attach(holder, port);
        var sender = new UdpClient();
        byte[] osc = Osc("/gsac/expression/jawOpen", 0.8f), cut = new byte[osc.Length - 4];
        Array.Copy(osc, cut, cut.Length);
        byte[][] sent = { Encoding.UTF8.GetBytes("not a message"), cut, Encoding.UTF8.GetBytes("{\"joints\":{\"left_elbow\":[0,-1.5,0]}}"), osc };
        foreach (byte[] raw in sent) sender.Send(raw, raw.Length, new IPEndPoint(IPAddress.Loopback, port));
        for (int i = 0; i < 200 && stream.Stream.Received + stream.Stream.Refused < sent.Length; i++) System.Threading.Thread.Sleep(10);
        new GsacPoseStreamEditor { target = stream.Stream }.OnInspectorGUI();
        Console.WriteLine(string.Join(", ", Player.Labels));
        Action frame = Player.Frame(new[] { holder });
        int elbow = avatar.Data.Joint("left_elbow"), jaw = Array.IndexOf(avatar.Data.Expressions, "jawOpen");
        for (int i = 0; i < 40; i++)
        {
            frame();
            Quaternion q = avatar.Joints[elbow].localRotation;
            double degrees = 2 * Math.Atan2(q.y, q.w) * 180 / Math.PI;
            Console.WriteLine(degrees.ToString(CultureInfo.InvariantCulture) + " " + avatar.Weights[jaw].ToString(CultureInfo.InvariantCulture));
        }
        // another port while the stream runs
        int received = stream.Stream.Received;
        stream.Stream.Port = other;
        sender.Send(osc, osc.Length, new IPEndPoint(IPAddress.Loopback, port));
        sender.Send(osc, osc.Length, new IPEndPoint(IPAddress.Loopback, other));
        for (int i = 0; i < 200 && stream.Stream.Received == received; i++) System.Threading.Thread.Sleep(10);
        System.Threading.Thread.Sleep(50);
        Console.WriteLine("moved " + (stream.Stream.Received - received));
        // another file while the stream runs
        avatar.Use((byte[])File.ReadAllBytes(file).Clone());
        frame();
        Player.Call(stream.Stream, "OnDisable");
    }

    static byte[] Osc(string address, params float[] numbers)
    {
        var bytes = new List<byte>();
        foreach (string word in new[] { address, "," + new string('f', numbers.Length) })
        {
            bytes.AddRange(Encoding.ASCII.GetBytes(word));
            do bytes.Add(0); while (bytes.Count % 4 != 0);
        }
        foreach (float number in numbers) bytes.AddRange(BigEndian(BitConverter.GetBytes(number)));
        return bytes.ToArray();
    }

    static byte[] Bundle(params byte[][] messages)
    {
        var bytes = new List<byte>(Encoding.ASCII.GetBytes("#bundle\0\0\0\0\0\0\0\0\u0001"));
        foreach (byte[] message in messages)
        {
            bytes.AddRange(BigEndian(BitConverter.GetBytes(message.Length)));
            bytes.AddRange(message);
        }
        return bytes.ToArray();
    }

    static byte[] BigEndian(byte[] number)
    {
        Array.Reverse(number);
        return number;
    }

    /// <summary>Adds a stream whose port is set before it is enabled.</summary>
    sealed class Probe : MonoBehaviour
    {
        public GsacPoseStream Stream;

        public void Attach(GameObject to, int port)
        {
            Stream = to.AddComponent<GsacPoseStream>();
            Player.Call(Stream, "OnDisable");
            Stream.Port = port;
            Player.Call(Stream, "OnEnable");
        }
    }

    /// <summary>Each file of a folder as a message: whether it was taken, and what the pose became.</summary>
    static void Messages(string file, string folder, string path)
    {
        GsacData data = GsacData.Read(File.ReadAllBytes(file)).Mirror();
        var message = new GsacPoseMessage(data);
        using (var dump = new Dump(path))
        {
            foreach (string name in Directory.GetFiles(folder))
            {
                var heard = new GsacLivePose(data);
                byte[] raw = File.ReadAllBytes(name);
                Console.WriteLine(Path.GetFileName(name) + " " + message.Read(raw, raw.Length, heard));
                dump.Put(Path.GetFileName(name) + ".rotation", heard.Pose.Rotation);
                dump.Put(Path.GetFileName(name) + ".transl", heard.Pose.Transl);
                dump.Put(Path.GetFileName(name) + ".weights", heard.Weights);
            }
        }
    }

    /// <summary>The benchmark scene at 100 frames a second, every fortieth frame 50 ms long.</summary>
    static void Benchmark(string file, string folder)
    {
        Player.SetDataPath(folder);
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        var benchmark = new GameObject("benchmark").AddComponent<GsacBenchmark>();
        Player.SetField(benchmark, "avatar", avatar);
        Player.SetField(benchmark, "duration", 20f);
        Player.Call(benchmark, "OnEnable");
        Action frame = Player.Frame(new[] { avatar.gameObject, benchmark.gameObject });
        var poses = new HashSet<float>();
        int elbow = avatar.Data.Joint("left_shoulder");
        for (int i = 0; i < 10000 && benchmark.ResultFile == null; i++)
        {
            Player.SetDeltaTime(i % 40 == 39 ? 0.05f : 0.01f);
            frame();
            poses.Add(avatar.Joints[elbow].localRotation.z);
        }
        Console.WriteLine(benchmark.ResultFile);
        Console.WriteLine(poses.Count);
    }

    /// <summary>What the importer makes of a file.</summary>
    static void Import(string file)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        foreach (string word in context.Words) Console.WriteLine(word);
        var root = context.mainObject as GameObject;
        if (root == null) return;
        Console.WriteLine(root.name + ": " + string.Join(" ", context.Added.Keys));
        foreach (Transform t in root.transform.GetComponentsInChildren<Transform>(true))
        {
            Vector3 p = t.position;
            Console.WriteLine("joint " + t.name + " " + (t.parent == null ? "-" : t.parent.name) + " "
                + string.Format(CultureInfo.InvariantCulture, "{0} {1} {2}", p.x, p.y, p.z));
        }
        foreach (HumanBone bone in Player.Description((Avatar)context.Added["humanoid"]).human) Console.WriteLine("human " + bone.boneName + "," + bone.humanName);
        Console.WriteLine("skeleton " + Player.Description((Avatar)context.Added["humanoid"]).skeleton.Length);
        var mesh = (Mesh)context.Added["mesh"];
        double volume = 0;
        for (int f = 0; f < mesh.triangles.Length; f += 3)
        {
            Vector3 a = mesh.vertices[mesh.triangles[f]], b = mesh.vertices[mesh.triangles[f + 1]], c = mesh.vertices[mesh.triangles[f + 2]];
            volume += (a.x * (b.y * c.z - b.z * c.y) + a.y * (b.z * c.x - b.x * c.z) + a.z * (b.x * c.y - b.y * c.x)) / 6;
        }
        Console.WriteLine("volume " + volume.ToString(CultureInfo.InvariantCulture));
        // the prefab draws: its asset is read again and its joints are found, not made anew
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        Player.SetPlaying(false);
        Player.Frame(new[] { root })();
        Console.WriteLine("draws " + draws + " transforms " + root.transform.GetComponentsInChildren<Transform>(true).Length);
    }

    /// <summary>Two instances, another avatar, the end: buffers and words.</summary>
    static void Life(string file)
    {
        byte[] bytes = File.ReadAllBytes(file);
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        var both = new[] { GsacLoader.Load(bytes, "one").gameObject, GsacLoader.Load(bytes, "two").gameObject };
        both[1].transform.SetPositionAndRotation(new Vector3(0, 0, -5), Quaternion.identity); // not among each other
        Player.Frame(both)();
        int two = Player.BuffersAlive;
        Console.WriteLine("draws " + draws);
        var avatar = both[0].GetComponent<GsacAvatar>();
        avatar.Use((byte[])bytes.Clone());
        Player.Frame(both)();
        Console.WriteLine("draws " + draws + ", more buffers " + (Player.BuffersAlive > two) + ", transforms "
                          + avatar.GetComponentsInChildren<Transform>(true).Length);
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 0, 0));
        Player.Frame(both)();
        Console.WriteLine("draws " + draws + " looking away");
        foreach (GameObject o in both)
        {
            Player.Call(o.GetComponent<GsacRenderer>(), "OnDisable");
            Player.Call(o.GetComponent<GsacAvatar>(), "OnDisable");
        }
        Console.WriteLine("buffers " + Player.BuffersAlive);
        foreach (Action wrong in new Action[]
        {
            () => avatar.SetJoint("tail", new Vector3()), () => avatar.SetExpression("sneeze", 1), () => avatar.ShowPose("X"),
            () => avatar.PlayClip("fly"), () => avatar.SetSmplx(new float[4], null), () => avatar.SetSmplx(new float[3], new float[600]),
            () => GsacLoader.Load(new byte[10], "bad"), () => new GameObject("empty").AddComponent<GsacAvatar>().TPose(),
        })
        {
            try
            {
                wrong();
                Console.WriteLine("nothing was said");
            }
            catch (Exception e)
            {
                Console.WriteLine(e.GetType().Name + ": " + e.Message);
            }
        }
        Player.SetComputeShaders(false);
        GsacAvatar lame = GsacLoader.Load(bytes, "lame");
        Player.Frame(new[] { lame.gameObject })();
        Player.Frame(new[] { lame.gameObject })();
        Console.WriteLine(Player.Errors.Count + " " + Player.Errors[0]);
    }
}
