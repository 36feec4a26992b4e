using System;
using System.Collections.Generic;
using System.IO;
using Gsac;
using UnityEngine;
using UnityEngine.Rendering.HighDefinition;

/// <summary>Avatars that are drawn into pictures of their own, in a project with linear colours.</summary>
public static class DrawOwn
{
    static readonly string[] Lenses = { "wide", "tele", "flat" };

    /// <summary>Dumps for each lens what the picture is drawn and laid with; prints a line for each situation: splats' indices, triangles', pictures.</summary>
    public static void Picture(string file, string path)
    {
        Player.HasHalfTargets = true;
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        avatar.TPose();
        avatar.SkipFade();
        var renderer = avatar.GetComponent<GsacRenderer>();
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(0.4f, 1.3f, 4), Quaternion.Euler(3, 182, 2));
        int own = 0, laid = 0;
        float linear = 0;
        MaterialPropertyBlock asked = null;
        Player.OnOwnDraw = (properties, count) =>
        {
            own += count / 6;
            asked = properties;
        };
        Player.OnDraw = (drawn, indices, count) =>
        {
            laid += count / 6;
            linear = Player.Value(drawn.matProps, Shader.PropertyToID("GsacBlend")).w;
        };
        Action frame = Player.Frame(new[] { avatar.gameObject });
        Action<string> tell = what =>
        {
            own = laid = 0;
            frame();
            Console.WriteLine(what + ": " + own + " " + laid + " " + Player.Alive<RenderTexture>() + " " + linear);
        };
        using (var dump = new Dump(path))
        {
            foreach (string lens in Lenses)
            {
                camera.projectionMatrix = lens == "flat" ? new Matrix4x4 { m00 = 0.6f, m11 = 0.9f, m22 = -0.01f, m03 = 0.1f, m13 = -0.05f, m33 = 1 }
                    : new Matrix4x4 { m00 = lens == "tele" ? 5 : 1, m11 = lens == "tele" ? 9 : 1.7f, m02 = 0.03f, m12 = -0.02f, m22 = -1, m23 = -0.02f, m32 = -1 };
                tell(lens);
                foreach (string name in new[] { "GsacEyeView", "GsacEyeProjection" }) dump.Put(lens + "." + name, Rows(Player.Matrix(asked, Shader.PropertyToID(name))));
                dump.Put(lens + ".lens", Rows(camera.projectionMatrix));
                Vector4 screen = Player.Value(asked, Shader.PropertyToID("GsacEyeScreen"));
                dump.Put(lens + ".GsacEyeScreen", new[] { screen.x, screen.y, screen.z, screen.w });
                foreach (string name in new[] { "GsacEyeRect", "GsacEyeLens", "GsacEyePlace" })
                {
                    Vector4 v = Player.Values(asked, Shader.PropertyToID(name))[0];
                    dump.Put(lens + "." + name, new[] { v.x, v.y, v.z, v.w });
                }
                var picture = (RenderTexture)Player.Texture(asked, Shader.PropertyToID("GsacTrained"));
                dump.Put(lens + ".size", new[] { picture.width, picture.height });
            }
            var places = new List<float>();
            foreach (Transform joint in avatar.Joints) places.AddRange(new[] { joint.position.x, joint.position.y, joint.position.z });
            dump.Put("joints", places.ToArray());
        }
        camera.projectionMatrix = new Matrix4x4 { m00 = 1, m11 = 1.7f, m22 = -1, m23 = -0.02f, m32 = -1 };
        tell("again");
        int sizes = 0;
        Texture before = null;
        for (int i = 0; i < 200; i++)
        {
            camera.transform.SetPositionAndRotation(new Vector3(0.4f, 1.3f, 4 - i * 0.005f), Quaternion.Euler(3, 182 + i * 0.05f, 2));
            frame();
            Texture now = Player.Texture(asked, Shader.PropertyToID("GsacTrained"));
            if (now != before) sizes++;
            before = now;
        }
        Console.WriteLine("new pictures in a walk of a metre: " + sizes);
        Player.SetRect(camera, 0.5f, 1);
        tell("part of a screen");
        Console.WriteLine("copy: " + Player.Value(asked, Shader.PropertyToID("GsacEyeScreen")).w);
        Player.SetRect(camera, 1, 1);
        GsacRefraction.Tell();
        foreach (var pipeline in new UnityEngine.Rendering.RenderPipeline[] { null, new HDRenderPipeline() })
        {
            foreach (bool there in new[] { true, false })
            {
                HDCamera.GetOrCreate(camera).SetRefraction(there);
                Player.SetPipeline(pipeline);
                frame();
                Console.WriteLine((pipeline == null ? "other pipeline" : "HDRP") + (there ? " with" : " without") + " refraction: "
                                  + Player.Value(asked, Shader.PropertyToID("GsacBehindIsCopied")).x);
            }
        }
        Player.SetPipeline(null);
        Player.SetEyes(camera, new[] { 1f, 1f });
        tell("headset");
        renderer.TrainedColours = false;
        tell("headset, switched off");
        Player.SetEyes(camera, null);
        tell("switched off");
        Player.Call(renderer, "OnDisable");
        Console.WriteLine("gone: " + Player.Alive<RenderTexture>() + " " + Player.Alive<Material>());
    }

    /// <summary>Dumps what each eye's part of a headset's picture is drawn with, and what the picture is laid over the scene with.</summary>
    public static void Headset(string file, string path)
    {
        Player.HasHalfTargets = true;
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        avatar.TPose();
        avatar.SkipFade();
        Camera camera = Player.AddCamera("headset");
        camera.transform.SetPositionAndRotation(new Vector3(0.4f, 1.3f, 2), Quaternion.Euler(3, 182, 2));
        Player.SetEyes(camera, new[] { 1.4f, 1.7f });
        int eye = 0;
        using (var dump = new Dump(path))
        {
            MaterialPropertyBlock asked = null;
            Player.OnOwnDraw = (properties, count) =>
            {
                asked = properties;
                foreach (string name in new[] { "GsacEyeView", "GsacEyeProjection" })
                    dump.Put(eye + "." + name, Rows(Player.Matrix(properties, Shader.PropertyToID(name))));
                Rect part = Player.OwnViewport;
                dump.Put(eye + ".part", new[] { part.x, part.y, part.width, part.height });
                dump.Put(eye + ".lens", Rows(camera.GetStereoProjectionMatrix((Camera.StereoscopicEye)eye)));
                dump.Put(eye + ".view", Rows(camera.GetStereoViewMatrix((Camera.StereoscopicEye)eye)));
                eye++;
            };
            Player.OnDraw = (drawn, indices, count) => { };
            Player.Frame(new[] { avatar.gameObject })();
            for (int e = 0; e < 2; e++)
            {
                foreach (string name in new[] { "GsacEyeRect", "GsacEyeLens", "GsacEyePlace" })
                {
                    Vector4 v = Player.Values(asked, Shader.PropertyToID(name))[e];
                    dump.Put(e + "." + name, new[] { v.x, v.y, v.z, v.w });
                }
            }
            var picture = (RenderTexture)Player.Texture(asked, Shader.PropertyToID("GsacTrained"));
            dump.Put("size", new[] { picture.width, picture.height });
            dump.Put("GsacParts", new[] { Player.Value(asked, Shader.PropertyToID("GsacParts")).x, eye });
            var places = new List<float>();
            foreach (Transform joint in avatar.Joints) places.AddRange(new[] { joint.position.x, joint.position.y, joint.position.z });
            dump.Put("joints", places.ToArray());
        }
    }

    /// <summary>What the body's mesh wears, situation by situation.</summary>
    public static void Dressed(string file)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        GsacAvatar other = GsacLoader.Load(File.ReadAllBytes(file), "other");
        var renderer = avatar.GetComponent<GsacRenderer>();
        SkinnedMeshRenderer body = avatar.Body;
        Action frame = Player.Frame(new[] { avatar.gameObject, other.gameObject });
        Action<string> tell = what =>
        {
            frame();
            Material[] worn = body.sharedMaterials;
            Console.WriteLine(what + ": " + (worn.Length > 0 && worn[0] != null ? worn.Length : 0) + " " + (body.sharedMaterial == other.Body.sharedMaterial)
                              + " " + body.shadowCastingMode + " " + body.enabled + " " + Player.Alive<Material>());
        };
        tell("loaded");
        renderer.BodyPass = false;
        tell("switched off");
        renderer.BodyPass = true;
        renderer.Opacity = 0;
        tell("faded away");
        renderer.Opacity = 0.5f;
        tell("half there");
        Player.Call(renderer, "OnDisable");
        Console.WriteLine("renderer off: " + (body.sharedMaterial == null));
        Player.Call(renderer, "OnEnable");
        var own = new Material(Resources.Load<Shader>("mine"));
        body.sharedMaterial = own;
        tell("own material");
        renderer.BodyPass = false;
        tell("own material, switched off");
    }

    static float[] Rows(Matrix4x4 m)
    {
        var rows = new List<float>();
        for (int r = 0; r < 4; r++)
        {
            Vector4 v = m.GetRow(r);
            rows.AddRange(new[] { v.x, v.y, v.z, v.w });
        }
        return rows.ToArray();
    }
}
