using System;
using System.Collections.Generic;
using System.IO;
using Gsac;
using UnityEditor;
using UnityEditor.SceneManagement;
using UnityEngine;

/// <summary>Which cameras show an avatar, and what that costs the GPU.</summary>
public static class Drawing
{
    static int dispatches, draws;

    static GsacAvatar Person(string file)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        avatar.TPose();
        avatar.SkipFade();
        Player.OnDispatch = (shader, kernel, groups) => dispatches++;
        Player.OnDraw = (asked, indices, count) => draws++;
        return avatar;
    }

    static void Tell(string what, Action act)
    {
        dispatches = draws = 0;
        act();
        Console.WriteLine(what + ": " + dispatches + " " + draws);
    }

    static void Turn(Camera camera, float degrees)
    {
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, degrees, 0));
    }

    /// <summary>A line for each situation: dispatches and draws.</summary>
    public static void Cameras(string file)
    {
        GsacAvatar avatar = Person(file);
        GameObject person = avatar.gameObject;
        Camera camera = Player.AddCamera("eye");
        Turn(camera, 180);
        Action frame = Player.Frame(new[] { person });
        Tell("first", frame);
        int whole = dispatches;
        Tell("still", frame);
        Turn(camera, 181);
        Tell("turned", frame);
        Console.WriteLine("sort: " + (dispatches > 0 && dispatches < whole));
        avatar.SetJoint("left_elbow", new Vector3(0, -1, 0));
        Tell("posed", frame);
        Console.WriteLine("whole: " + (dispatches == whole));
        Tell("still again", frame);
        avatar.SetExpression(avatar.Data.Expressions[0], 0.7f);
        Tell("expression", frame);
        avatar.GetComponent<GsacRenderer>().ClipLight = 0.3f;
        Tell("even light stays even", frame);
        foreach (float aside in new[] { 180 + 85, 180 - 85, 0f })
        {
            Turn(camera, aside);
            avatar.SetJoint("left_elbow", new Vector3(0, -aside / 360, 0));
            Tell("out of view " + aside, frame);
        }
        Turn(camera, 180);
        camera.transform.SetPositionAndRotation(new Vector3(0, 9, 4), Quaternion.Euler(0, 180, 0));
        Tell("above", frame);
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 90), Quaternion.Euler(0, 180, 0));
        camera.projectionMatrix = new Matrix4x4 { m00 = 1, m11 = 1.7f, m22 = -1.002f, m23 = -0.6f, m32 = -1 }; // far plane: 300 m
        Tell("within the far plane", frame);
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 900), Quaternion.Euler(0, 180, 0));
        Tell("beyond the far plane", frame);
        Turn(camera, 180);
        camera.cullingMask = ~(1 << person.layer);
        Tell("layer culled", frame);
        camera.cullingMask = -1;
        Player.SetEyes(camera, new[] { 1f, 1f });
        Tell("headset", frame);
        Turn(camera, 0);
        Tell("headset looks away", frame);
        Player.SetEyes(camera, null);

        Camera second = new GameObject("by hand").AddComponent<Camera>();
        Turn(second, 180);
        Turn(camera, 0);
        frame();
        Tell("by hand", second.Render);
        Tell("by hand again", second.Render);
        avatar.SetJoint("left_elbow", new Vector3(0, -1.5f, 0));
        avatar.Refresh(0);
        Tell("by hand, posed after the frame's joints were taken", second.Render);
        avatar.GetComponent<GsacRenderer>().Refresh();
        Tell("by hand, refreshed", second.Render);
        Player.HasPipeline = true;
        Turn(second, 182);
        Tell("by hand in a pipeline", second.Render);
        Player.HasPipeline = false;

        Turn(camera, 180);
        frame();
        Turn(second, 183);
        Tell("second camera", second.Render);
        Tell("first camera after it", camera.Render);

        System.Runtime.CompilerServices.RuntimeHelpers.RunClassConstructor(typeof(GsacImporter).Assembly.GetType("Gsac.GsacSceneViews").TypeHandle);
        SceneVisibilityManager.instance.Hidden.Add(person);
        Tell("hidden in scene views, the game", camera.Render);
        camera.cameraType = CameraType.SceneView;
        Tell("hidden in scene views", camera.Render);
        SceneVisibilityManager.instance.Hidden.Clear();
        Tell("scene view", camera.Render);
        StageUtility.Staged[camera] = new GameObject("another prefab");
        Tell("another's prefab stage", camera.Render);
        StageUtility.Staged[camera] = person;
        Tell("own prefab stage", camera.Render);
    }

    /// <summary>Gaussians drawn for a far camera by its lens, and for two cameras at once.</summary>
    public static void Zoom(string file)
    {
        GsacAvatar avatar = Person(file);
        Camera far = Player.AddCamera("far"), near = Player.AddCamera("near");
        far.transform.SetPositionAndRotation(new Vector3(0, 1, 30), Quaternion.Euler(0, 180, 0));
        Turn(near, 0);
        Player.OnDraw = (asked, indices, count) => Console.WriteLine(asked.camera.name + ": " + count / 6);
        Action frame = Player.Frame(new[] { avatar.gameObject });
        foreach (float zoom in new[] { 1f, 10f, 2.5f })
        {
            far.projectionMatrix = new Matrix4x4 { m00 = zoom, m11 = 1.7320508f * zoom, m22 = -1, m23 = -0.02f, m32 = -1 };
            frame();
        }
        far.projectionMatrix = new Matrix4x4 { m00 = 0.3f, m11 = 0.3f, m22 = -0.01f, m33 = 1 }; // without perspective, 6.7 m high
        frame();
        far.projectionMatrix = new Matrix4x4 { m00 = 0.05f, m11 = 0.05f, m22 = -0.01f, m33 = 1 };
        frame();
        Turn(near, 180);
        frame();
    }

    /// <summary>A line for each of three frames, the camera rendered one, two, three times: the draws' numbers, and the one that counts.</summary>
    public static void Repeated(string file)
    {
        GameObject person = Person(file).gameObject;
        Camera camera = Player.AddCamera("eye");
        Turn(camera, 180);
        string line = "";
        uint[] latest = null;
        Player.OnDraw = (asked, indices, count) =>
        {
            line += Player.Value(asked.matProps, Shader.PropertyToID("GsacNumber")).x + " ";
            latest = Player.Words(Player.Buffer(asked.matProps, Shader.PropertyToID("GsacLatest")));
        };
        Action frame = Player.Frame(new[] { person });
        for (int more = 0; more < 3; more++)
        {
            line = "";
            frame();
            for (int n = 0; n < more; n++) camera.Render();
            Console.WriteLine(line + "counts " + latest[0]);
        }
    }

    /// <summary>What the draw is told: material, tint and share, fog; a line for each change on the component.</summary>
    public static void Finish(string file)
    {
        var renderer = Person(file).GetComponent<GsacRenderer>();
        Camera camera = Player.AddCamera("eye");
        Turn(camera, 180);
        var own = new Material(null) { name = "own" };
        Player.OnDraw = (asked, indices, count) =>
        {
            Vector4 tint = Player.Value(asked.matProps, Shader.PropertyToID("GsacTint"));
            Console.WriteLine(string.Format(System.Globalization.CultureInfo.InvariantCulture, "{0} {1} {2} {3} {4} {5}", asked.material.name ?? "package",
                tint.x, tint.y, tint.z, tint.w, Player.Value(asked.matProps, Shader.PropertyToID("GsacFog")).x));
        };
        foreach (Action change in new Action[]
        {
            () => { }, () => renderer.Tint = new Color(0.5f, 1, 0, 0.1f), () => renderer.Opacity = 0.25f, () => renderer.Opacity = 7,
            () => renderer.Fog = false, () => renderer.Material = own, () => renderer.Material = null,
        })
        {
            change();
            camera.Render();
        }
        renderer.Opacity = 0;
        Turn(camera, 181);
        Tell("faded", camera.Render);
    }

    /// <summary>Materials and Avatars that live, with two people, one, none; in play and in edit mode.</summary>
    public static void Freed(string file)
    {
        Camera camera = Player.AddCamera("eye");
        Turn(camera, 180);
        foreach (bool playing in new[] { true, false })
        {
            Player.SetPlaying(true);
            GsacAvatar one = Person(file), two = Person(file);
            Player.SetPlaying(playing);
            Player.Frame(new[] { one.gameObject, two.gameObject })();
            Console.WriteLine("two: " + Player.Alive<Material>() + " " + Player.Alive<Avatar>());
            if (playing) two.Use(File.ReadAllBytes(file));
            Console.WriteLine("another file: " + Player.Alive<Avatar>());
            foreach (GsacAvatar avatar in new[] { one, two })
            {
                Player.Call(avatar.GetComponent<GsacRenderer>(), "OnDisable");
                Player.Call(avatar, "OnDisable");
                Console.WriteLine("off: " + Player.Alive<Material>() + " " + Player.Alive<Avatar>());
                Player.Call(avatar, "OnDestroy");
            }
            Console.WriteLine("gone: " + Player.Alive<Material>() + " " + Player.Alive<Avatar>());
        }
    }
    /// <summary>What stays of a person whose avatar is switched off while the renderer is on, and goes after.</summary>
    public static void Closed(string file)
    {
        Camera camera = Player.AddCamera("eye");
        Turn(camera, 180);
        GsacAvatar avatar = Person(file);
        Action frame = Player.Frame(new[] { avatar.gameObject });
        var models = (System.Collections.IDictionary)typeof(GsacModel).GetField("Shared", System.Reflection.BindingFlags.NonPublic | System.Reflection.BindingFlags.Static).GetValue(null);
        SkinnedMeshRenderer body = avatar.Body;
        Action<string> tell = what => Console.WriteLine(what + ": " + models.Count + " " + (body.sharedMaterial != null));
        frame();
        tell("on");
        avatar.enabled = false;
        Player.Call(avatar, "OnDisable");
        tell("off");
        avatar.GetComponent<GsacRenderer>().Refresh();
        Player.Call(avatar.GetComponent<GsacRenderer>(), "LateUpdate");
        Player.Call(avatar.GetComponent<GsacRenderer>(), "OnDisable");
        tell("a frame later, the renderer off too");
        Console.WriteLine("materials: " + Player.Alive<Material>());
    }
    /// <summary>Another file on the field of a person who is switched off and on: how many weights are drawn, of how many the file has.</summary>
    public static void Swapped(string file, string other)
    {
        var avatar = new GameObject("person").AddComponent<GsacAvatar>();
        foreach (string path in new[] { file, other })
        {
            Player.Call(avatar, "OnDisable");
            Player.SetField(avatar, "bytes", Player.Text(File.ReadAllBytes(path)));
            Player.Call(avatar, "LateUpdate");
            Console.WriteLine(avatar.DrawnWeights.Length + " " + avatar.Data.Expressions.Length);
        }
    }
}
