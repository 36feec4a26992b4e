using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Reflection;
using Gsac;
using Gsac.Samples;
using Meta.XR.EnvironmentDepth;
using UnityEngine;
using UnityEngine.Playables;
using UnityEngine.XR;
using UnityEngine.XR.ARFoundation;
using UnityEngine.XR.ARKit;
using UnityEngine.XR.Hands;

/// <summary>Plays the package's samples and tells what they did.</summary>
public static class AdoptSamples
{
    static byte[] file;
    static string path;

    public static void Run(string sample, string given)
    {
        path = given;
        file = File.ReadAllBytes(path);
        typeof(AdoptSamples).GetMethod(sample, BindingFlags.Static | BindingFlags.NonPublic).Invoke(null, null);
    }

    static void Say(FormattableString words)
    {
        Console.WriteLine(words.ToString(CultureInfo.InvariantCulture));
    }

    static GsacCast Cast(int count)
    {
        var cast = new GameObject("People").AddComponent<GsacCast>();
        Player.Call(cast, "OnDisable");
        cast.People = new[] { GsacLoader.Load(file, "prefab") };
        Player.SetField(cast, "count", count);
        Player.SetField(cast.People[0], "bytes", Player.Text(file));
        Player.Call(cast, "OnEnable");
        return cast;
    }

    static T Begun<T>(GameObject on, params object[] fields) where T : MonoBehaviour
    {
        var made = on.AddComponent<T>();
        for (int i = 0; i < fields.Length; i += 2) Player.SetField(made, (string)fields[i], fields[i + 1]);
        return made;
    }

    static void Mecanim()
    {
        GsacCast cast = Cast(1);
        var still = Begun<GsacMecanim>(new GameObject("still"), "cast", cast);
        Player.Call(still, "Start");
        Player.Call(still, "Update");
        Say($"{Player.Errors[Player.Errors.Count - 1]}");
        AnimationClip walk = new AnimationClip { name = "walk" }, wave = new AnimationClip { name = "wave" };
        cast.First.TPose();
        var sample = Begun<GsacMecanim>(new GameObject("Mecanim"), "cast", cast, "first", walk, "second", wave);
        Player.Call(sample, "Start");
        sample.Blend = 0.25f;
        Player.Call(sample, "Update");
        Node node = PlayableGraph.Outputs[cast.First.GetComponent<Animator>()];
        Say($"{node.Inputs[0].Clip.name} {node.Weights[0]} {node.Inputs[1].Clip.name} {node.Weights[1]} {cast.First.Source}");
        Player.Call(sample, "OnDestroy");
    }

    static void Timeline()
    {
        GsacCast cast = Cast(1);
        var track = new GsacFaceTrack();
        Playable mixer = track.CreateTrackMixer(new PlayableGraph(), null, 3);
        for (int i = 0; i < 3; i++)
        {
            var clip = new GsacFaceClip();
            typeof(GsacFaceClip).GetField("expression", BindingFlags.Instance | BindingFlags.NonPublic).SetValue(clip, i == 2 ? "sneeze" : "jawOpen");
            mixer.Node.Inputs[i] = clip.CreatePlayable(new PlayableGraph(), null).Node;
        }
        int jaw = Array.IndexOf(cast.First.Data.Expressions, "jawOpen"), brow = Array.IndexOf(cast.First.Data.Expressions, "browInnerUp");
        cast.First.SetExpression("browInnerUp", 0.4f);
        foreach (float share in new[] { 0.25f, 0.75f, 0 })
        {
            mixer.Node.Weights[0] = share;
            mixer.Node.Weights[1] = share / 2;
            mixer.Node.Behaviour.ProcessFrame(mixer, new FrameData(), cast.First);
            Say($"{cast.First.Weights[jaw]} {cast.First.Weights[brow]}");
        }
    }

    static void Faces()
    {
        GsacCast cast = Cast(1);
        int jaw = Array.IndexOf(cast.First.Data.Expressions, "jawOpen");
        var phone = new GameObject("Face capture");
        var manager = phone.AddComponent<ARFaceManager>();
        Begun<GsacARKitFace>(phone, "manager", manager);
        var capture = Begun<GsacFaceCapture>(phone, "cast", cast, "smoothing", 0f);
        Player.Call(capture, "Start");
        Player.Call(capture, "LateUpdate");
        Say($"no face {cast.First.Weights[jaw]}");
        manager.subsystem = new ARKitFaceSubsystem { Seen = new[] { new ARKitBlendShapeCoefficient { blendShapeLocation = ARKitBlendShapeLocation.JawOpen, coefficient = 0.75f } } };
        manager.trackables = new TrackableCollection<ARFace> { All = new List<ARFace> { phone.AddComponent<ARFace>() } };
        Player.Call(capture, "LateUpdate");
        Say($"seen {cast.First.Weights[jaw]} {cast.First.Source}");
        manager.trackables = new TrackableCollection<ARFace> { All = new List<ARFace>() };
        Player.Call(capture, "LateUpdate");
        Say($"lost {cast.First.Weights[jaw]}");
        var other = new GameObject("other").AddComponent<SkinnedMeshRenderer>();
        other.sharedMesh = new Mesh { vertices = new Vector3[1] };
        other.sharedMesh.AddBlendShapeFrame("jawOpen", 100, new Vector3[1], null, null);
        other.SetBlendShapeWeight(0, 50);
        var copy = Begun<GsacFaceCapture>(new GameObject("copy"), "cast", cast, "smoothing", 0f, "other", other);
        Player.Call(copy, "Start");
        Player.Call(copy, "LateUpdate");
        Say($"copied {cast.First.Weights[jaw]}");
    }

    static void Crowd()
    {
        GsacCast cast = Cast(20);
        var crowd = Begun<GsacCrowdOfTwenty>(new GameObject("Crowd"), "cast", cast);
        Player.SetDeltaTime(1);
        int playing = 0;
        for (int i = 0; i < 10; i++)
        {
            Player.Call(crowd, "Update");
            playing = Array.FindAll(cast.Standing, person => person.Source == GsacSource.Clip).Length;
            if (i == 0 || i == 9) Say($"playing {playing} of {cast.Standing.Length}");
        }
    }

    static void Head()
    {
        var head = new GameObject("eye").AddComponent<GsacHead>();
        Player.Call(head, "Update");
        Say($"{head.transform.position.y}");
        InputDevices.Places[XRNode.CenterEye] = new Vector3(1, 1.25f, 2);
        Player.BeforeRender();
        Vector3 p = head.transform.position;
        Say($"{p.x} {p.y} {p.z}");
    }

    /// <summary>A room that is all known.</summary>
    sealed class Room : MonoBehaviour, IGsacRoom
    {
        public bool Shown;
        public Texture Picture = new Texture2D(2, 2);
        public void ShowRoom(bool shown) { Shown = shown; }
        public bool TryDepth(GsacRoomDepth depth)
        {
            depth.Texture = Picture;
            depth.Metres = new Vector4(0.2f, -1, 0, 0);
            return true;
        }
        public bool TryFloor(Vector3 from, Vector3 ahead, out Vector3 place)
        {
            place = new Vector3(from.x, -0.25f, from.z - 2);
            return true;
        }
    }

    sealed class Fingers : MonoBehaviour, IGsacHands
    {
        public Vector3? Left, Right;
        public bool TryTip(bool left, out Vector3 tip)
        {
            Vector3? at = left ? Left : Right;
            tip = at ?? Vector3.zero;
            return at != null;
        }
    }

    static void Reality()
    {
        GsacCast cast = Cast(1);
        Camera eye = Player.AddCamera("eye");
        eye.transform.SetPositionAndRotation(new Vector3(0, 1.5f, 3), Quaternion.Euler(30, 180, 0));
        var holder = new GameObject("Room");
        var reality = Begun<GsacMixedReality>(holder, "cast", cast, "eye", eye, "depthShader", Resources.Load<Shader>("room depth"));
        Player.Call(reality, "Start");
        Player.Call(reality, "LateUpdate");
        Say($"{Player.Errors[Player.Errors.Count - 1]}");
        var room = holder.AddComponent<Room>();
        Player.Call(reality, "Start");
        Player.Call(reality, "LateUpdate");
        Material drawn = Graphics.Drawn[0].Key;
        Say($"shown {room.Shown} {eye.clearFlags} {eye.backgroundColor.a} depth {ReferenceEquals(drawn.Set["GsacRoomDepth"], room.Picture)} away {drawn.Set["GsacRoomAway"]:F2}");
        reality.Passthrough = false;
        Player.Call(reality, "LateUpdate");
        Say($"shown {room.Shown} {eye.clearFlags} draws {Graphics.Drawn.Count}");

        var alone = Begun<GsacFloorPlacement>(new GameObject("no room"), "cast", cast, "pointer", eye.transform);
        Say($"placed {alone.Place()}");
        Where(cast.First);
        eye.transform.SetPositionAndRotation(new Vector3(0, 1.5f, 3), Quaternion.Euler(-10, 180, 0));
        Say($"looking up {alone.Place()}");
        var placement = Begun<GsacFloorPlacement>(holder, "cast", cast, "pointer", eye.transform);
        Player.Call(placement, "Start");
        Where(cast.First);

        var fingers = new GameObject("Hands").AddComponent<Fingers>();
        var board = new GameObject("Panel");
        board.transform.SetPositionAndRotation(new Vector3(1, 1.5f, 0), Quaternion.Euler(0, 90, 0));
        var panel = Begun<GsacPosePanel>(board, "cast", cast, "placement", placement, "reality", reality, "hands", fingers);
        Player.Call(panel, "Start");
        Say($"{string.Join(", ", panel.Words)}");
        foreach (string word in new[] { "A-pose", "jawOpen", "Room" })
        {
            int row = Array.IndexOf(panel.Words, word);
            fingers.Left = new Vector3(1, 1.5f - 0.05f * row, 0.05f);
            Player.Call(panel, "Update");
            Player.Call(panel, "Update"); // stays there: pressed once
            fingers.Left = new Vector3(1.2f, 1.5f, 0);
            Player.Call(panel, "Update");
        }
        int jaw = Array.IndexOf(cast.First.Data.Expressions, "jawOpen");
        Say($"pressed {cast.First.Source} {cast.First.Weights[jaw]} {reality.Passthrough}");

        var touch = Begun<GsacTouch>(new GameObject("touch"), "cast", cast, "hands", fingers, "smoothing", 0f);
        var told = new List<string>();
        touch.Touched += (left, joint) => told.Add((left ? "left " : "right ") + joint);
        cast.First.TPose();
        cast.First.SkipFade();
        cast.First.Refresh(0);
        GsacData data = cast.First.Data;
        Vector3 a = cast.First.Joints[data.Joint("left_elbow")].position, b = cast.First.Joints[data.Joint("left_wrist")].position;
        fingers.Left = null;
        fingers.Right = (a + b) * 0.5f + new Vector3(0, 0.05f, 0);
        Player.Call(touch, "LateUpdate");
        Player.Call(touch, "LateUpdate");
        string held = touch.TouchedBy(false);
        fingers.Right = new Vector3(0, 3, 0);
        Player.Call(touch, "LateUpdate");
        Say($"touched {string.Join(", ", told)}; {held}; {touch.TouchedBy(false) ?? "nothing"}");
    }

    static void Where(GsacAvatar person)
    {
        Vector3 p = person.transform.position, f = person.transform.forward;
        Say($"stands {p.x:F2} {p.y:F2} {p.z:F2} looks {f.x:F2} {f.z:F2}");
    }

    static void Makers()
    {
        var meta = new GameObject("meta");
        var layer = meta.AddComponent<OVRPassthroughLayer>();
        var measured = meta.AddComponent<EnvironmentDepthManager>();
        var quest = Begun<GsacMetaRoom>(meta, "layer", layer, "measured", measured);
        quest.ShowRoom(true);
        var depth = new GsacRoomDepth();
        bool early = quest.TryDepth(depth);
        measured.IsDepthAvailable = true;
        Shader.Globals["_EnvironmentDepthTexture"] = new Texture2D(2, 2);
        Shader.Globals["_EnvironmentDepthReprojectionMatrices"] = new[] { Matrix4x4.identity, Matrix4x4.Translate(new Vector3(1, 2, 3)) };
        Shader.Globals["_EnvironmentDepthZBufferParams"] = new Vector4(0.2f, -1, 0, 0);
        Say($"{layer.hidden} {measured.enabled} {early} {quest.TryDepth(depth)} {depth.FromWorld[1].m13} {depth.Metres.x}");
        var ar = new GameObject("ar");
        var seen = ar.AddComponent<ARCameraManager>();
        var planes = ar.AddComponent<ARRaycastManager>();
        var room = Begun<GsacARRoom>(ar, "seen", seen, "planes", planes);
        room.ShowRoom(false);
        Vector3 floor;
        bool none = room.TryFloor(Vector3.zero, Vector3.forward, out floor);
        foreach (float height in new[] { 0.7f, 0 }) planes.Met.Add(new ARRaycastHit { pose = new Pose { position = new Vector3(0, height, 2) } });
        Say($"{seen.enabled} {none} {room.TryFloor(Vector3.zero, Vector3.forward, out floor)} {floor.y} {room.TryDepth(depth)}");
        var occlusion = ar.AddComponent<AROcclusionManager>();
        var origin = new GameObject("origin");
        origin.transform.localPosition = new Vector3(10, 0, 0);
        Player.SetField(room, "measured", occlusion);
        Player.SetField(room, "origin", origin.transform);
        bool without = room.TryDepth(depth);
        Shader.Globals["_EnvironmentDepthProjectionMatrices"] = new[] { Matrix4x4.identity, Matrix4x4.Translate(new Vector3(1, 2, 3)) };
        Shader.Globals["_NdcLinearConversionParameters"] = new Vector4(-0.2f, -1, 0, 0);
        bool with = room.TryDepth(depth);
        room.ShowRoom(false);
        Say($"{without} {with} {depth.FromWorld[0].m03} {depth.FromWorld[1].m03} {depth.Metres.x} {room.TryDepth(depth)}");
        var hands = new GameObject("hands").AddComponent<GsacXRHands>();
        Vector3 tip;
        none = hands.TryTip(true, out tip);
        SubsystemManager.Running.Add(new XRHandSubsystem { leftHand = new XRHand { isTracked = true, Place = new Vector3(1, 2, 3) } });
        Say($"{none} {hands.TryTip(true, out tip)} {tip.y} {hands.TryTip(false, out tip)}");
        var controllers = new GameObject("controllers").AddComponent<GsacControllers>();
        none = controllers.TryTip(true, out tip);
        InputDevices.Places[XRNode.RightHand] = new Vector3(0, 1, 0);
        Say($"{none} {controllers.TryTip(false, out tip)} {tip.z}");
    }

    /// <summary>The package's own tests, each with its outcome; of the first person where there is one.</summary>
    static void OwnTests()
    {
        foreach (bool there in new[] { false, true })
        {
            GsacCast.FindPeople = () => there ? new[] { Adopt.Imported(path) } : new GsacAvatar[0];
            UnityEditor.AssetDatabase.Project.Clear();
            if (there) Adopt.Imported(path);
            Player.OnRender = camera =>
            {
                var seen = UnityEngine.Player.Last<GsacCast>().First;
                camera.targetTexture.Pixels = Adopt.Pictured(seen, camera.backgroundColor, camera.worldToCameraMatrix, camera.projectionMatrix, 256, 256, true);
            };
            foreach (Type type in new[] { typeof(Gsac.Tests.GsacReadingTests), typeof(Gsac.Tests.GsacPictureTests), typeof(Gsac.Tests.GsacImportTests) })
            {
                foreach (MethodInfo test in type.GetMethods(BindingFlags.Public | BindingFlags.Instance | BindingFlags.DeclaredOnly)) Console.WriteLine(test.Name + " " + Outcome(type, test));
            }
        }
    }

    static string Outcome(Type type, MethodInfo test)
    {
        try
        {
            var steps = test.Invoke(Activator.CreateInstance(type), null) as System.Collections.IEnumerator;
            while (steps != null && steps.MoveNext())
            {
            }
            return "passed";
        }
        catch (Exception e)
        {
            Exception inner = e is TargetInvocationException ? e.InnerException : e;
            return inner is NUnit.Framework.IgnoreException ? "ignored" : inner.ToString();
        }
    }
}
