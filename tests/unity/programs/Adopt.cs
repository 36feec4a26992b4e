using System;
using System.Collections;
using System.Collections.Concurrent;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Reflection;
using System.Threading;
using System.Threading.Tasks;
using Gsac;
using UnityEditor;
using UnityEditor.AssetImporters;
using UnityEditor.Build.Reporting;
using UnityEngine;
using UnityEngine.SceneManagement;

/// <summary>What a studio does with the package's people: files of the project, scenes, loading.</summary>
public static class Adopt
{
    public static GsacAvatar Imported(string file)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        AssetDatabase.Project[file] = context.mainObject;
        return ((GameObject)context.mainObject).GetComponent<GsacAvatar>();
    }

    /// <summary>People of the project in a scene that names nobody: edited, played, built.</summary>
    public static void Cast(string file)
    {
        System.Runtime.CompilerServices.RuntimeHelpers.RunClassConstructor(typeof(GsacCastFiller).TypeHandle);
        var nobody = new GameObject("People").AddComponent<GsacCast>();
        Console.WriteLine("standing " + nobody.Standing.Length + " " + Player.Errors[0]);
        Imported(file);
        Player.SetPlaying(false);
        var cast = new GameObject("People").AddComponent<GsacCast>();
        Console.WriteLine("edited " + cast.Standing.Length + " " + cast.First.gameObject.hideFlags);
        Player.Call(cast, "OnDisable");
        Player.SetPlaying(true);
        Player.SetField(cast, "count", 5);
        Player.Call(cast, "OnEnable");
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        Player.Frame(Array.ConvertAll(cast.Standing, a => a.gameObject))();
        Console.WriteLine("played " + cast.Standing.Length + " " + cast.First.gameObject.hideFlags + " draws " + draws);
        foreach (GsacAvatar avatar in cast.Standing)
        {
            Vector3 p = avatar.transform.position;
            Console.WriteLine(string.Format(CultureInfo.InvariantCulture, "place {0} {1} {2}", p.x, p.y, p.z));
        }
        var scene = new Scene { Roots = new List<GameObject> { cast.gameObject } };
        new GsacCastFiller().OnProcessScene(scene, null);
        Console.WriteLine("named " + cast.People.Length);
        Player.Call(cast, "OnDisable");
        cast.People = new GsacAvatar[] { null, GsacCastFiller.FindPeople()[0] };
        Player.Call(cast, "OnEnable");
        Console.WriteLine("with a deleted prefab " + cast.Standing.Length);
        cast.People = new GsacAvatar[0];
        new GsacCastFiller().OnProcessScene(scene, new BuildReport());
        Console.WriteLine("named " + cast.People.Length);
    }

    /// <summary>Plays Unity's main thread: what is awaited goes on in the next frame.</summary>
    sealed class Frames : SynchronizationContext
    {
        readonly BlockingCollection<Action> waiting = new BlockingCollection<Action>();
        public int Count;

        public override void Post(SendOrPostCallback d, object state) { waiting.Add(() => d(state)); }

        public void RunUntil(Task task)
        {
            while (!task.IsCompleted)
            {
                Action next;
                if (!waiting.TryTake(out next, 20)) continue;
                Count++;
                next();
            }
        }
    }

    /// <summary>A file loaded without a halt: where it was parsed, how many frames it took, what is left where it was stopped or bad.</summary>
    public static void LoadAsync(string file, string broken)
    {
        var frames = new Frames();
        SynchronizationContext.SetSynchronizationContext(frames);
        int main = Thread.CurrentThread.ManagedThreadId;
        var uploads = new HashSet<int>();
        Player.OnUpload = () =>
        {
            uploads.Add(Thread.CurrentThread.ManagedThreadId);
            Thread.Sleep(3);
        };
        Task<GsacAvatar> task = GsacLoader.LoadAsync(file);
        Console.WriteLine("at once " + task.IsCompleted);
        frames.RunUntil(task);
        GsacAvatar avatar = task.Result;
        Console.WriteLine(avatar.name + " frames " + (frames.Count > 6) + " uploads " + (uploads.Count == 1 && uploads.Contains(main)));
        Player.OnUpload = null;
        int alive = Player.BuffersAlive;
        Player.AddCamera("eye").transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        int draws = 0;
        Player.OnDraw = (asked, indices, count) => draws++;
        Player.Frame(new[] { avatar.gameObject })();
        Console.WriteLine("draws " + draws + " before " + (alive > 0));
        Player.Call(avatar.GetComponent<GsacRenderer>(), "OnDisable");
        Player.Call(avatar, "OnDisable");
        Console.WriteLine("buffers " + Player.BuffersAlive);
        var stop = new CancellationTokenSource();
        Player.OnUpload = () =>
        {
            Thread.Sleep(3);
            stop.Cancel();
        };
        task = GsacLoader.LoadAsync(file, stop.Token);
        frames.RunUntil(task);
        Console.WriteLine("stopped " + task.IsCanceled + " buffers " + Player.BuffersAlive);
        Player.OnUpload = () =>
        {
            Thread.Sleep(3);
            Player.SetPlaying(false);
        };
        task = GsacLoader.LoadAsync(File.ReadAllBytes(file), "Ada");
        frames.RunUntil(task);
        Console.WriteLine("play mode ended " + task.IsCanceled + " buffers " + Player.BuffersAlive);
        Player.SetPlaying(true);
        foreach (string path in new[] { broken, broken + ".none" })
        {
            task = GsacLoader.LoadAsync(path);
            frames.RunUntil(task);
            Exception e = task.Exception.InnerException;
            Console.WriteLine(e.GetType().Name + " " + e.Message);
        }
    }

    /// <summary>The plain picture of a posed person for a camera, with perspective and without.</summary>
    public static void Paint(string file, string numbers, string path)
    {
        GsacAvatar avatar = Play.Posed(file, Play.Numbers(numbers));
        avatar.transform.localPosition = new Vector3(0.4f, 0.1f, -0.7f);
        avatar.transform.localRotation = Quaternion.Euler(5, 40, -3);
        avatar.transform.localScale = new Vector3(1.2f, 1.2f, 1.2f);
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(1.5f, 1.6f, 2.5f), Quaternion.Euler(12, 215, 2));
        Player.Frame(new[] { avatar.gameObject })();
        avatar.CollectWeights();
        var bones = new Vector4[avatar.Data.JointCount * 3];
        GsacSkeleton.Bones(avatar.Data, avatar.transform, avatar.Joints, bones);
        Matrix4x4 toEye = camera.worldToCameraMatrix * avatar.transform.localToWorldMatrix;
        var lens = new Matrix4x4 { m00 = 460 / 256f, m11 = 460 / 256f, m02 = 0.1f, m12 = -0.05f, m22 = -1, m32 = -1 };
        var flat = new Matrix4x4 { m00 = 0.9f, m11 = 0.9f, m03 = 0.1f, m13 = -0.05f, m22 = -1, m33 = 1 };
        using (var dump = new Dump(path))
        {
            dump.Put("perspective", GsacPainter.Paint(avatar.Data, bones, avatar.DrawnWeights, toEye, lens, 256, 256));
            dump.Put("flat", GsacPainter.Paint(avatar.Data, bones, avatar.DrawnWeights, toEye, flat, 256, 256));
            dump.Put("toEye", new[] { toEye.m00, toEye.m01, toEye.m02, toEye.m03, toEye.m10, toEye.m11, toEye.m12, toEye.m13, toEye.m20, toEye.m21, toEye.m22, toEye.m23 });
        }
    }

    /// <summary>A prefab's thumbnail as numbers, then what a click meets and F frames of a person who was put somewhere.</summary>
    public static void Look(string file, string path)
    {
        var context = new AssetImportContext { assetPath = file };
        new GsacImporter().OnImportAsset(context);
        var pixels = new List<float>();
        foreach (Color32 c in context.Thumbnail.GetPixels32()) pixels.AddRange(new float[] { c.r, c.g, c.b, c.a });
        var person = ((GameObject)context.mainObject).GetComponent<GsacAvatar>();
        Player.SetPlaying(false);
        person.transform.localPosition = new Vector3(3, 0, 1);
        var inspector = new GsacAvatarEditor { target = person };
        Bounds framed = inspector.OnGetFrameBounds();
        typeof(GsacSceneBounds).GetMethod("Draw", BindingFlags.NonPublic | BindingFlags.Static).Invoke(null, new object[] { person, GizmoType.Pickable });
        var balls = new List<float>();
        foreach (KeyValuePair<Vector3, float> ball in Gizmos.Balls) balls.AddRange(new[] { ball.Key.x, ball.Key.y, ball.Key.z, ball.Value });
        using (var dump = new Dump(path))
        {
            dump.Put("thumbnail", pixels.ToArray());
            dump.Put("framed", new[] { framed.center.x, framed.center.y, framed.center.z, framed.size.x, framed.size.y, framed.size.z });
            dump.Put("balls", balls.ToArray());
        }
        Console.WriteLine("frames " + inspector.HasFrameBounds());
        var empty = new GameObject("empty").AddComponent<GsacAvatar>();
        Console.WriteLine("empty frames " + new GsacAvatarEditor { target = empty }.HasFrameBounds());
    }

    /// <summary>A camera's picture as Unity would give it: the plain one before the camera's colour, lowest row first; or nobody.</summary>
    public static Color32[] Pictured(GsacAvatar avatar, Color behind, Matrix4x4 view, Matrix4x4 projection, int width, int height, bool there)
    {
        var bones = new Vector4[avatar.Data.JointCount * 3];
        GsacSkeleton.Bones(avatar.Data, avatar.transform, avatar.Joints, bones);
        avatar.CollectWeights();
        float[] plain = GsacPainter.Paint(avatar.Data, bones, avatar.DrawnWeights, view * avatar.transform.localToWorldMatrix, projection, width, height);
        var pixels = new Color32[width * height];
        for (int i = 0; i < pixels.Length; i++)
        {
            int at = there ? ((height - 1 - i / width) * width + i % width) * 4 : 0;
            float through = 1 - plain[at + 3];
            Func<float, float, byte> mix = (over, under) => (byte)(255 * (over + through * under) + 0.5f);
            pixels[i] = new Color32(mix(plain[at], behind.r), mix(plain[at + 1], behind.g), mix(plain[at + 2], behind.b), 255);
        }
        return pixels;
    }

    class UniversalPipeline : UnityEngine.Rendering.RenderPipelineAsset
    {
    }

    /// <summary>The menu in a project with two pipelines of which one draws nobody; the files it wrote.</summary>
    public static void SelfCheck(string file, string folder)
    {
        Player.SetDataPath(folder);
        Player.SetPlaying(false);
        GsacSelfCheckMenu.Begin();
        Console.WriteLine(Player.Labels[0]);
        Imported(file);
        var urp = new UniversalPipeline();
        AssetDatabase.Project["Settings/URP.asset"] = urp;
        var usual = new UniversalPipeline();
        QualitySettings.renderPipeline = usual;
        Player.OnRender = camera =>
        {
            camera.projectionMatrix = camera.orthographic ? new Matrix4x4 { m00 = 0.9f, m11 = 0.9f, m22 = -1, m33 = 1 }
                                                          : new Matrix4x4 { m00 = 2.7f, m11 = 2.7f, m22 = -1, m32 = -1 };
            var person = (GsacAvatar)typeof(GsacSelfCheckMenu).GetField("person", BindingFlags.NonPublic | BindingFlags.Static).GetValue(null);
            bool there = UnityEngine.Rendering.GraphicsSettings.currentRenderPipeline != urp;
            camera.targetTexture.Pixels = Pictured(person, camera.backgroundColor, camera.worldToCameraMatrix, camera.projectionMatrix, 256, 256, there);
        };
        GsacSelfCheckMenu.Begin();
        for (int i = 0; i < 200 && EditorApplication.update != null; i++) EditorApplication.update();
        foreach (string path in GsacSelfCheckMenu.Written) Console.WriteLine(path);
        Console.WriteLine("restored " + ReferenceEquals(QualitySettings.renderPipeline, usual));
    }

    /// <summary>The scene in a player with a headset.</summary>
    public static void EyeCheck(string file, string folder)
    {
        Player.SetDataPath(folder);
        GsacAvatar prefab = Imported(file);
        var cast = new GameObject("People").AddComponent<GsacCast>();
        Player.Call(cast, "OnDisable");
        cast.People = new[] { prefab };
        Player.Call(cast, "OnEnable");
        Camera eye = Player.AddCamera("eye");
        eye.transform.SetPositionAndRotation(new Vector3(0, 1, 3), Quaternion.Euler(0, 180, 0));
        eye.backgroundColor = new Color(0.2f, 0.3f, 0.4f, 1);
        Player.SetEyes(eye, new[] { 1.5f, 1.6f });
        Player.OnRender = camera => camera.targetTexture.Pixels = Pictured(cast.First, camera.backgroundColor, camera.worldToCameraMatrix, camera.projectionMatrix, 256, 256, true);
        Player.OnCapture = () =>
        {
            var both = new Texture2D(200, 120);
            var pixels = new Color32[200 * 120];
            foreach (Camera.StereoscopicEye side in new[] { Camera.StereoscopicEye.Left, Camera.StereoscopicEye.Right })
            {
                Color32[] one = Pictured(cast.First, eye.backgroundColor, eye.GetStereoViewMatrix(side), eye.GetStereoProjectionMatrix(side), 100, 120, true);
                for (int i = 0; i < one.Length; i++) pixels[i / 100 * 200 + (int)side * 100 + i % 100] = one[i];
            }
            both.SetPixels32(pixels);
            return both;
        };
        var check = new GameObject("check").AddComponent<GsacSelfCheck>();
        Player.SetField(check, "cast", cast);
        Player.SetField(check, "eye", eye);
        var steps = (IEnumerator)typeof(GsacSelfCheck).GetMethod("Start", BindingFlags.NonPublic | BindingFlags.Instance).Invoke(check, null);
        while (steps.MoveNext())
        {
        }
        Console.WriteLine(check.ResultFile);
    }
}
