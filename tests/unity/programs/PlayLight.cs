using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using Gsac;
using UnityEngine;

/// <summary>An avatar in the light of a scene.</summary>
public static class PlayLight
{
    static readonly string[] Rows = { "GsacSceneRed", "GsacSceneGreen", "GsacSceneBlue", "GsacSceneRed2", "GsacSceneGreen2", "GsacSceneBlue2", "GsacSceneLast" };

    /// <summary>
    /// numbers: 27 of the probe, 3 of the sun's colour, its intensity, degrees of its turn about x and y, those of the avatar's about x, y, z, the share,
    /// the exposure. Prints the seven rows of the light that the gaussians are bound in, a line for each moment, before each its name.
    /// </summary>
    public static void Scene(string file, string numbers)
    {
        float[] n = Array.ConvertAll(numbers.Split(' '), word => float.Parse(word, CultureInfo.InvariantCulture));
        var probe = new UnityEngine.Rendering.SphericalHarmonicsL2();
        for (int i = 0; i < 27; i++) probe[i / 9, i % 9] = n[i];
        Player.Probe = probe;
        Light sun = new GameObject("sun").AddComponent<Light>();
        sun.color = new Color(n[27], n[28], n[29], 1);
        sun.intensity = n[30];
        sun.transform.localRotation = Quaternion.Euler(n[31], n[32], 0);
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        avatar.transform.localRotation = Quaternion.Euler(n[33], n[34], n[35]);
        avatar.transform.localScale = new Vector3(1.5f, 1.5f, 1.5f);
        Camera camera = Player.AddCamera("eye");
        camera.transform.SetPositionAndRotation(new Vector3(0, 1, 4), Quaternion.Euler(0, 180, 0));
        GsacSceneLight scene = avatar.GetComponent<GsacRenderer>().SceneLight;
        var shown = new List<string>();
        Player.OnDispatch = (shader, kernel, groups) =>
        {
            if (kernel != shader.FindKernel("Bind")) return;
            shown.Clear();
            foreach (string name in Rows)
            {
                Vector4 row = Player.Value(shader, Shader.PropertyToID(name));
                shown.Add(string.Format(CultureInfo.InvariantCulture, "{0:R} {1:R} {2:R} {3:R}", row.x, row.y, row.z, row.w));
            }
        };
        Action frame = Player.Frame(new[] { avatar.gameObject });
        Action<string> tell = what =>
        {
            frame();
            Console.WriteLine(what + ": " + string.Join(" ", shown.ToArray()));
        };
        tell("of itself");
        scene.Share = n[36];
        scene.Exposure = n[37];
        tell("no sun");
        scene.Sun = sun;
        tell("sun");
        Player.BeforeSun.Add(avatar.Joints[15]);
        tell("a hand before the eyes");
        Player.BeforeSun.Add(new GameObject("roof").transform);
        sun.shadows = LightShadows.None;
        tell("without shadows");
        sun.shadows = LightShadows.Soft;
        tell("stepped into the shade");
        for (int i = 0; i < 200; i++) frame();
        tell("in the shade");
        shown.Clear();
        tell("still there");
        scene.Share = 0;
        tell("clip again");
        scene.Share = n[36];
        tell("begins in the shade");
    }
}
