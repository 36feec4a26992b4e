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

/// <summary>Commands of the tests of what drives an avatar: streams, clips, blend shapes, the inspector, other people's objects.</summary>
public static class Drive
{
    public static int Run(string[] args)
    {
        switch (args[0])
        {
            case "parts": Parts(args[1], int.Parse(args[2])); break;
            case "props": Props(args[1]); break;
            case "swap": Swap(args[1], args[2], args[3]); break;
            case "broken": Broken(args[1], args[2]); break;
            case "nudge": Nudge(args[1]); break;
            case "several": Several(args[1]); break;
            case "clip": Clip(args[1]); break;
            case "saved": Saved(args[1]); break;
            case "body": Body(args[1], args[2], args[3]); break;
            case "clips": Clips(args[1], args[2]); break;
            case "reach": Reach(args[1]); break;
            case "face": Face(args[1]); break;
            default: return 2;
        }
        return 0;
    }

    static void Say(string what, params double[] numbers)
    {
        Console.WriteLine(what + " " + string.Join(" ", Array.ConvertAll(numbers, n => Math.Round(n, 4).ToString(CultureInfo.InvariantCulture))));
    }

    static double Degrees(Transform joint)
    {
        Quaternion q = joint.localRotation;
        return 2 * Math.Atan2(Math.Sqrt(q.x * q.x + q.y * q.y + q.z * q.z), q.w) * 180 / Math.PI;
    }

    static Transform Joint(GsacAvatar avatar, string name)
    {
        return avatar.Joints[avatar.Data.Joint(name)];
    }

    static GsacAvatar Imported(string file)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        return ((GameObject)context.mainObject).GetComponent<GsacAvatar>();
    }

    /// <summary>Turns some joints anew each frame, as an Animator does.</summary>
    sealed class Mecanim : MonoBehaviour
    {
        public readonly List<Transform> Joints = new List<Transform>();

        void Update()
        {
            foreach (Transform joint in Joints) joint.localRotation = Quaternion.Euler(0, 0, 60);
        }
    }

    /// <summary>A person whom an Animator moves, and a stream over it: of the face, then with each mask.</summary>
    static void Parts(string file, int port)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        var mecanim = avatar.gameObject.AddComponent<Mecanim>();
        string[] names = { "left_shoulder", "left_elbow", "left_index1", "jaw" };
        foreach (string name in names) mecanim.Joints.Add(Joint(avatar, name));
        var stream = avatar.gameObject.AddComponent<GsacPoseStream>();
        Player.Call(stream, "OnDisable");
        stream.Port = port;
        Player.Call(stream, "OnEnable");
        Action frame = Player.Frame(new[] { avatar.gameObject });
        var sender = new UdpClient();
        Action<string> send = text =>
        {
            byte[] raw = Encoding.UTF8.GetBytes(text);
            int before = stream.Received;
            sender.Send(raw, raw.Length, new IPEndPoint(IPAddress.Loopback, port));
            for (int i = 0; i < 200 && stream.Received == before; i++) System.Threading.Thread.Sleep(10);
        };
        Action<string> tell = what =>
        {
            for (int i = 0; i < 60; i++) frame();
            var numbers = new List<double>();
            foreach (string name in names) numbers.Add(Degrees(Joint(avatar, name)));
            numbers.Add(avatar.Joints[0].localPosition.x);
            numbers.Add(avatar.Weights[Array.IndexOf(avatar.Data.Expressions, "jawOpen")]);
            Say(what + " " + avatar.Source + " " + avatar.GetComponent<Animator>().enabled, numbers.ToArray());
        };
        frame();
        send("{\"expression\":{\"jawOpen\":0.5}}");
        frame();
        tell("face-only");
        send("{\"joints\":{\"left_elbow\":[0,-1.5,0],\"left_index1\":[0,0,0.5],\"jaw\":[0.2,0,0]},\"transl\":[-1,0,0],\"expression\":{\"jawOpen\":0.9}}");
        foreach (GsacParts parts in new[] { GsacParts.Hands, GsacParts.Face, GsacParts.Body, GsacParts.All, GsacParts.Face | GsacParts.Hands })
        {
            stream.Parts = parts;
            tell(parts.ToString().Replace(", ", "+"));
        }
        stream.Parts = GsacParts.All;
        Transform knee = Joint(avatar, "left_knee");
        mecanim.Joints.Add(knee);
        frame();
        send("{\"joints\":{\"left_knee\":[0,-1.5,0]}}");
        Quaternion stood = knee.localRotation;
        frame();
        Quaternion began = Quaternion.Inverse(stood) * knee.localRotation;
        Say("began", 2 * Math.Acos(Math.Min(Math.Abs(began.w), 1)) * 180 / Math.PI);
        Player.Call(stream, "OnDisable");
    }

    /// <summary>A second person in the first one's hand, and props that are called as joints are.</summary>
    static void Props(string file)
    {
        GsacAvatar avatar = Imported(file);
        Transform[] before = (Transform[])avatar.Joints.Clone();
        Transform wrist = Joint(avatar, "left_wrist");
        foreach (string name in new[] { "head", "jaw", "neck", "pelvis", "left_wrist" }) new GameObject(name).transform.SetParent(wrist, false);
        GsacLoader.Load(File.ReadAllBytes(file), "doll").transform.SetParent(wrist, false);
        Player.Call(avatar, "OnDisable");
        int other = 0;
        for (int j = 0; j < before.Length; j++) other += ReferenceEquals(before[j], avatar.Joints[j]) ? 0 : 1;
        Console.WriteLine("taken over " + other);
        // the user's own child by the name of ours
        GsacAvatar loaded = new GameObject("person").AddComponent<GsacAvatar>();
        new GameObject("Body").transform.SetParent(loaded.transform, false);
        loaded.Use(File.ReadAllBytes(file));
        Player.Call(loaded, "OnDisable");
        bool sound = loaded.IsOpen && loaded.Body.sharedMesh != null;
        loaded.Use(File.ReadAllBytes(file));
        Console.WriteLine("children " + loaded.transform.childCount + " " + sound);
    }

    /// <summary>Another person in the place of one that carries the user's things; then a broken file, then other joints.</summary>
    static void Swap(string file, string other, string skull)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        Transform head = Joint(avatar, "head");
        var plate = new GameObject("plate").transform;
        plate.SetParent(avatar.transform, false);
        var eye = new GameObject("eye").transform;
        eye.SetParent(head, false);
        eye.localPosition = new Vector3(0, 0.1f, 0.2f);
        avatar.SetExpression("jawOpen", 1);
        avatar.SetJoint("left_elbow", new Vector3(0, 1, 0));
        Action frame = Player.Frame(new[] { avatar.gameObject });
        frame();
        avatar.Use(File.ReadAllBytes(other));
        frame();
        Console.WriteLine("alive " + (plate != null && eye != null) + " " + plate.parent.name + " " + eye.parent.name + " same joints "
                          + ReferenceEquals(head, Joint(avatar, "head")) + " people " + avatar.transform.childCount);
        Say("elbow", Degrees(Joint(avatar, "left_elbow")), avatar.Weights[Array.IndexOf(avatar.Data.Expressions, "jawOpen")]);
        Vector3 p = head.position;
        Say("head", p.x, p.y, p.z);
        try
        {
            avatar.Use(new byte[10]);
        }
        catch (GsacException e)
        {
            Console.WriteLine("refused: " + e.Message + "; still there " + avatar.IsOpen + " " + ReferenceEquals(head, Joint(avatar, "head")));
        }
        p = eye.position;
        avatar.Use(File.ReadAllBytes(skull));
        frame();
        Vector3 q = eye.position;
        Console.WriteLine("other joints: alive " + (plate != null && eye != null) + " " + plate.parent.name + " " + eye.parent.name
                          + " old head " + (head != null) + " new " + (avatar.Data.Joint("skull") >= 0 && Joint(avatar, "skull").name == "skull")
                          + " moved " + (Vector3.Distance(p, q) > 1e-5f));
    }

    /// <summary>A broken file, shown and asked; then one that can be read in its place.</summary>
    static void Broken(string file, string sound)
    {
        var avatar = new GameObject("person").AddComponent<GsacAvatar>();
        Player.SetField(avatar, "bytes", Player.Text(File.ReadAllBytes(file)));
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        var stream = avatar.gameObject.AddComponent<GsacPoseStream>();
        Action frame = Player.Frame(new[] { avatar.gameObject });
        for (int i = 0; i < 5; i++) frame();
        Player.Call(stream, "OnDisable");
        Console.WriteLine("read " + Player.FilesRead + " said " + Player.Errors.Count + ": " + string.Join("; ", Player.Errors));
        try
        {
            avatar.TPose();
        }
        catch (GsacException e)
        {
            Console.WriteLine("calls say " + e.Message);
        }
        avatar.Use(File.ReadAllBytes(sound));
        frame();
        Console.WriteLine("said " + Player.Errors.Count + " draws " + draws);
    }

    /// <summary>The inspector's sliders where the joint stands elsewhere than they were left.</summary>
    static void Nudge(string file)
    {
        GsacAvatar avatar = Imported(file);
        Player.SetPlaying(false);
        var inspector = new GsacAvatarEditor { target = avatar };
        Transform shoulder = Joint(avatar, "left_shoulder"), elbow = Joint(avatar, "left_elbow");
        Action<string, Transform> tell = (what, joint) => Say(what, joint.localRotation.x, joint.localRotation.y, joint.localRotation.z, joint.localRotation.w);
        Action<string, float> slide = (label, value) =>
        {
            Player.Slides[label] = value;
            inspector.OnInspectorGUI();
            Player.Slides.Remove(label);
        };
        Player.Slides["Joint"] = avatar.Data.Joint("left_shoulder");
        inspector.OnInspectorGUI();
        Player.Pressed = "A-pose";
        inspector.OnInspectorGUI();
        Player.Pressed = null;
        tell("a-pose", shoulder);
        slide("x, degrees", 1);
        tell("nudged", shoulder);
        // another inspector keeps the other two axes
        elbow.localRotation = Quaternion.Euler(10, 20, 30);
        inspector = new GsacAvatarEditor { target = avatar };
        Player.Slides["Joint"] = avatar.Data.Joint("left_elbow");
        slide("x, degrees", 50);
        tell("fresh", elbow);
        // an angle beyond 90 degrees stays as it was put in
        foreach (float x in new[] { 89f, 91f, 120f }) slide("x, degrees", x);
        tell("far", elbow);
        UnityEditor.Undo.PerformUndo();
        tell("undone", elbow);
        Player.Slides["Joint"] = avatar.Data.Joint("left_knee");
        slide("x, degrees", 5);
        tell("still", elbow);
        UnityEditor.Undo.PerformUndo();
        slide("weight", 0.75f);
        double set = avatar.Weights[0];
        UnityEditor.Undo.PerformUndo();
        Say("weight", set, avatar.Weights[0]);
    }

    /// <summary>An inspector of two people.</summary>
    static void Several(string file)
    {
        var people = new[] { Imported(file), Imported(file) };
        Player.SetPlaying(false);
        Player.Chosen = people;
        var inspector = new GsacAvatarEditor { target = people[0] };
        Player.Slides["Joint"] = people[0].Data.Joint("left_elbow");
        Player.Slides["y"] = 60;
        Player.Slides["weight"] = 0.25f;
        Player.Slides["Clip"] = 2;
        inspector.OnInspectorGUI();
        foreach (GsacAvatar one in people)
        {
            Say(one.Clip, Degrees(Joint(one, "left_elbow")), one.Weights[0]);
        }
    }

    /// <summary>Clips of the file: another while one plays, one that is not there, speed, loop, end.</summary>
    static void Clip(string file)
    {
        GsacAvatar avatar = Imported(file);
        Action frame = Player.Frame(new[] { avatar.gameObject });
        int ends = 0;
        avatar.ClipEnded.AddListener(() => ends++);
        var pose = new GsacPose(avatar.Data.JointCount);
        Func<string, float, bool, double> off = (name, seconds, loop) =>
        {
            pose.Sample(avatar.Data.Clips[name], seconds, loop);
            double most = 0;
            for (int j = 0; j < avatar.Joints.Length; j++)
            {
                Quaternion q = avatar.Joints[j].localRotation;
                float[] r = pose.Rotation;
                double dot = Math.Abs(q.x * r[j * 4] + q.y * r[j * 4 + 1] + q.z * r[j * 4 + 2] + q.w * r[j * 4 + 3]);
                most = Math.Max(most, 2 * Math.Acos(Math.Min(dot, 1)) * 180 / Math.PI);
            }
            return Math.Round(most, 0);
        };
        avatar.Source = GsacSource.Clip;
        avatar.Clip = "wave";
        for (int i = 0; i < 60; i++) frame();
        Say("wave", off("wave", 1, true));
        avatar.Clip = "walk"; // as the inspector or undo sets the field
        for (int i = 0; i < 60; i++) frame();
        Say("walk", off("walk", 1, true));
        avatar.Speed = 0.5f;
        avatar.PlayClip("wave");
        avatar.SkipFade();
        for (int i = 0; i < 60; i++) frame();
        Say("half", off("wave", 0.5f, true));
        float length = GsacPose.Length(avatar.Data.Clips["walk"], false);
        avatar.Speed = 1;
        avatar.Loop = GsacLoop.Once;
        avatar.PlayClip("walk");
        avatar.SkipFade();
        for (int i = 0; i < 60 * length - 3; i++) frame();
        int early = ends;
        for (int i = 0; i < 60; i++) frame();
        Say("once", off("walk", length, false), early, ends);
        avatar.Speed = -1;
        avatar.PlayClip("walk");
        avatar.SkipFade();
        frame();
        Say("back", off("walk", length - 1 / 60f, false));
        for (int i = 0; i < 60 * length + 3; i++) frame();
        Say("begin", off("walk", 0, false), ends);
        avatar.Loop = GsacLoop.Always;
        avatar.Speed = 1;
        avatar.PlayClip("walk");
        for (int i = 0; i < 600; i++) frame();
        Say("always", ends);
        avatar.Clip = "wlak";
        for (int i = 0; i < 5; i++) frame();
        Console.WriteLine(Player.Errors.Count + " " + Player.Errors[0]);
    }

    /// <summary>A pose and a face set in edit mode, as a new component of the saved scene finds them.</summary>
    static void Saved(string file)
    {
        GsacAvatar avatar = Imported(file);
        Player.SetPlaying(false);
        var inspector = new GsacAvatarEditor { target = avatar };
        Player.Pressed = "A-pose";
        Player.Slides["weight"] = 0.75f;
        inspector.OnInspectorGUI();
        Player.Call(avatar, "OnDisable");
        Player.SetPlaying(true);
        var again = avatar.gameObject.AddComponent<GsacAvatar>();
        foreach (string field in new[] { "asset", "source", "clip" }) Player.SetField(again, field, Player.Field(avatar, field));
        avatar.enabled = false;
        Player.Call(again, "LateUpdate");
        Say("saved " + again.Source, Joint(again, "left_shoulder").localRotation.z, again.Weights[0]);
    }

    /// <summary>The mesh under a loaded person: shapes, bones, bounds in a pose.</summary>
    static void Body(string file, string numbers, string path)
    {
        GsacAvatar avatar = Play.Posed(file, Play.Numbers(numbers));
        SkinnedMeshRenderer body = avatar.Body;
        Mesh mesh = body.sharedMesh;
        Player.Frame(new[] { avatar.gameObject })();
        avatar.CollectWeights();
        var moved = new Vector3[mesh.vertices.Length];
        for (int i = 0; i < mesh.blendShapeCount; i++)
        {
            Vector3[] shape = Player.Shape(mesh, i);
            for (int v = 0; v < moved.Length; v++) moved[v] += shape[v] * (body.GetBlendShapeWeight(i) / 100);
        }
        using (var dump = new Dump(path))
        {
            for (int i = 0; i < Math.Min(2, mesh.blendShapeCount); i++) dump.Put("shape." + avatar.Data.Expressions[i], Flat(Player.Shape(mesh, i)));
            dump.Put("moved", Flat(moved));
            dump.Put("vertices", Flat(mesh.vertices));
            dump.Put("bounds", Flat(new[] { body.localBounds.center, body.localBounds.size }));
        }
        Console.WriteLine(body.transform.parent.name + " " + body.gameObject.name + " enabled " + body.enabled + " root bone " + body.rootBone.name);
        GsacAvatar twin = GsacLoader.Load(File.ReadAllBytes(file), "twin");
        GsacAvatar same = new GameObject("same").AddComponent<GsacAvatar>();
        byte[] bytes = File.ReadAllBytes(file);
        same.Use(bytes);
        twin.Use(bytes);
        Console.WriteLine("shared " + ReferenceEquals(same.Body.sharedMesh, twin.Body.sharedMesh));
        // off and on again: the mesh is freed and made anew, the face stays
        avatar.SetExpression("jawOpen", 0.5f);
        Player.Call(avatar, "OnDisable");
        bool freed = mesh == null;
        Say("on again " + freed + " " + (avatar.Body.sharedMesh != null), avatar.Weights[Array.IndexOf(avatar.Data.Expressions, "jawOpen")]);
    }

    /// <summary>Dispatches of frames in edit mode: the first, one in which nothing moves, one in which a blend shape does.</summary>
    static void Face(string file)
    {
        GsacAvatar avatar = Imported(file);
        Player.SetPlaying(false);
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int asked = 0;
        Player.OnDispatch = (shader, kernel, groups) => asked++;
        Action frame = Player.Frame(new[] { avatar.gameObject });
        foreach (float weight in new[] { 0f, 0, 60, 60 })
        {
            asked = 0;
            avatar.Body.SetBlendShapeWeight(avatar.Body.sharedMesh.GetBlendShapeIndex("jawOpen"), weight);
            frame();
            Say(asked > 0 ? "drawn" : "still", avatar.DrawnWeights[Array.IndexOf(avatar.Data.Expressions, "jawOpen")]);
        }
    }

    /// <summary>Hands and feet brought to places by script, by objects over an Animator and by the scene view's handles.</summary>
    static void Reach(string file)
    {
        GsacAvatar avatar = Imported(file);
        avatar.transform.SetPositionAndRotation(new Vector3(3, 0.5f, -2), Quaternion.Euler(0, 70, 0));
        var random = new System.Random(5);
        Func<float> one = () => (float)random.NextDouble() * 2 - 1;
        foreach (GsacEnd end in GsacLimb.Ends)
        {
            GsacLimb limb = GsacLimb.Find(avatar.Data, avatar.Joints, end);
            float length = Vector3.Distance(limb.Upper.position, limb.Middle.position) + Vector3.Distance(limb.Middle.position, limb.Tip.position);
            double off = 0, stretched = 0, shrunk = 0;
            for (int i = 0; i < 200; i++)
            {
                var to = new Vector3(one(), one(), one());
                float share = 0.25f + 0.7f * (float)random.NextDouble();
                Vector3 place = limb.Upper.position + to * (share * length / to.magnitude);
                avatar.Reach(end, place);
                off = Math.Max(off, Vector3.Distance(limb.Tip.position, place));
                avatar.Reach(end, limb.Upper.position + to * (3 * length / to.magnitude));
                stretched = Math.Max(stretched, length - Vector3.Distance(limb.Upper.position, limb.Tip.position));
                shrunk = Math.Max(shrunk, Math.Abs(Vector3.Distance(limb.Upper.position, limb.Middle.position)
                                                   + Vector3.Distance(limb.Middle.position, limb.Tip.position) - length));
            }
            avatar.TPose();
            avatar.Reach(end, limb.Upper.position); // no direction at all
            bool finite = !float.IsNaN(limb.Tip.position.x);
            // from straight: elbows go back, knees ahead
            avatar.TPose();
            avatar.SkipFade();
            avatar.Refresh(0);
            Vector3 straight = limb.Middle.position;
            avatar.Reach(end, limb.Upper.position + (limb.Tip.position - limb.Upper.position) * 0.8f);
            Vector3 bent = limb.Middle.position - straight;
            Vector3 ahead = avatar.transform.localRotation * Vector3.forward;
            avatar.TPose();
            Say(end.ToString() + " " + finite, off, stretched / length, shrunk, Vector3.Dot(bent, ahead) > 0.05f ? 1 : Vector3.Dot(bent, ahead) < -0.05f ? -1 : 0);
        }
        // over an Animator that holds the shoulder and elbow
        avatar.Source = GsacSource.Animator;
        var mecanim = avatar.gameObject.AddComponent<Mecanim>();
        mecanim.Joints.Add(Joint(avatar, "left_shoulder"));
        mecanim.Joints.Add(Joint(avatar, "left_elbow"));
        var reach = avatar.gameObject.AddComponent<GsacReach>();
        var goal = new GameObject("goal").transform;
        Transform wrist = Joint(avatar, "left_wrist");
        reach.SetGoal(GsacEnd.LeftHand, goal);
        Action frame = Player.Frame(new[] { avatar.gameObject });
        goal.SetPositionAndRotation(Joint(avatar, "left_shoulder").position + new Vector3(0.1f, -0.2f, 0.15f), Quaternion.Euler(0, 30, 0));
        reach.Turn = true;
        for (int i = 0; i < 10; i++) frame();
        Quaternion q = wrist.rotation, g = goal.rotation;
        Say("goal", Vector3.Distance(wrist.position, goal.position), Math.Abs(q.x * g.x + q.y * g.y + q.z * g.z + q.w * g.w));
        reach.SetGoal(GsacEnd.LeftHand, null);
        frame();
        Say("free", Degrees(Joint(avatar, "left_elbow")));
        // no Animator's clip, nothing else: the hand goes round and comes back
        mecanim.Joints.Clear();
        Transform shoulder = Joint(avatar, "left_shoulder");
        shoulder.localRotation = Joint(avatar, "left_elbow").localRotation = Quaternion.identity;
        reach.SetGoal(GsacEnd.LeftHand, goal);
        reach.Turn = false;
        var first = new Quaternion();
        for (int i = 0; i <= 400; i++)
        {
            double angle = i * Math.PI / 100;
            goal.SetPositionAndRotation(shoulder.position + new Vector3(0.25f * (float)Math.Cos(angle), 0.25f * (float)Math.Sin(angle), 0.2f), Quaternion.identity);
            frame();
            if (i == 0) first = shoulder.localRotation;
        }
        Quaternion last = shoulder.localRotation;
        reach.SetGoal(GsacEnd.LeftHand, null);
        frame();
        Say("round", Math.Abs(first.x * last.x + first.y * last.y + first.z * last.z + first.w * last.w), Degrees(shoulder), Degrees(Joint(avatar, "left_elbow")));
        // a handle dragged in edit mode, and undone
        avatar.SkipFade();
        Player.SetPlaying(false);
        var inspector = new GsacAvatarEditor { target = avatar };
        Vector3 before = wrist.position, to2 = shoulder.position + (before - shoulder.position) * 0.8f;
        Player.Drags[1] = to2;
        Player.HandlesSeen = 0;
        inspector.OnSceneGUI();
        double dragged = Vector3.Distance(wrist.position, to2);
        UnityEditor.Undo.PerformUndo();
        Say("handles", Player.HandlesSeen, dragged, Vector3.Distance(wrist.position, before));
    }

    static float[] Flat(Vector3[] rows)
    {
        var flat = new List<float>();
        foreach (Vector3 v in rows) flat.AddRange(new[] { v.x, v.y, v.z });
        return flat.ToArray();
    }

    /// <summary>The AnimationClips that the importer makes: their curves, and what they should hold.</summary>
    static void Clips(string file, string path)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        var avatar = ((GameObject)context.mainObject).GetComponent<GsacAvatar>();
        double turned = 0;
        foreach (Transform joint in avatar.Joints) turned = Math.Max(turned, Degrees(joint));
        Say("left turned by", turned);
        using (var dump = new Dump(path))
        {
            foreach (KeyValuePair<string, UnityEngine.Object> pair in context.Added)
            {
                var made = pair.Value as AnimationClip;
                if (made == null) continue;
                UnityEditor.AnimationClipSettings s = UnityEditor.AnimationUtility.GetAnimationClipSettings(made);
                Console.WriteLine(made.name + " " + made.frameRate + " " + s.loopTime + " " + (s.loopBlendOrientation && s.loopBlendPositionY && s.loopBlendPositionXZ
                                  && s.keepOriginalOrientation && s.keepOriginalPositionY && s.keepOriginalPositionXZ));
                foreach (KeyValuePair<string, AnimationCurve> curve in Player.Curves(made))
                {
                    float end = curve.Value.keys[curve.Value.keys.Length - 1].time;
                    var values = new List<float> { end };
                    for (int i = 0; i < 4 * (curve.Value.keys.Length - 1); i++) values.Add(curve.Value.Evaluate(i / 4f / made.frameRate));
                    dump.Put(made.name + "/" + curve.Key.Replace(' ', '_'), values.ToArray());
                }
            }
        }
    }
}
