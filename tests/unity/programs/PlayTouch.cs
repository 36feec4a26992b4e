using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Net;
using System.Threading;
using Gsac;
using UnityEngine;

/// <summary>The body as something to touch: rays, colliders; and a person by an address.</summary>
public static class Touch
{
    /// <summary>rays: six numbers each, origin and direction in the world. Dumps the hits and the surface; prints the joints.</summary>
    public static void Rays(string file, string numbers, string rays, string path)
    {
        GsacAvatar avatar = Play.Posed(file, Play.Numbers(numbers));
        avatar.transform.localPosition = new Vector3(0.4f, 0.1f, -0.7f);
        avatar.transform.localRotation = Quaternion.Euler(5, 40, -3);
        avatar.transform.localScale = new Vector3(1.2f, 1.2f, 1.2f);
        avatar.Refresh(0);
        float[] n = Play.Numbers(rays);
        var hits = new List<float>();
        for (int i = 0; i < n.Length; i += 6)
        {
            GsacHit hit;
            bool met = avatar.Raycast(new Ray(new Vector3(n[i], n[i + 1], n[i + 2]), new Vector3(n[i + 3], n[i + 4], n[i + 5])), out hit);
            hits.AddRange(new[] { met ? 1 : 0, hit.Distance, hit.Face, hit.Shares.x, hit.Shares.y, hit.Shares.z, hit.Position.x, hit.Position.y, hit.Position.z,
                                  hit.Normal.x, hit.Normal.y, hit.Normal.z });
            Console.WriteLine(hit.Joint ?? "nothing");
        }
        var bones = new Vector4[avatar.Data.JointCount * 3];
        GsacSkeleton.Bones(avatar.Data, avatar.transform, avatar.Joints, bones);
        avatar.CollectWeights();
        var surface = new GsacSurface(avatar.Data);
        surface.Pose(bones, avatar.DrawnWeights);
        var world = new List<float>();
        for (int v = 0; v < surface.Places.Length; v += 3)
        {
            Vector3 p = avatar.transform.localToWorldMatrix.MultiplyPoint3x4(
                new Vector3((float)surface.Places[v], (float)surface.Places[v + 1], (float)surface.Places[v + 2]));
            world.AddRange(new[] { p.x, p.y, p.z });
        }
        using (var dump = new Dump(path))
        {
            dump.Put("hits", hits.ToArray());
            dump.Put("world", world.ToArray());
        }
        GsacHit none;
        Console.WriteLine(avatar.Raycast(new Ray(new Vector3(n[0], n[1], n[2]), new Vector3(n[3], n[4], n[5])), out none, 0.5f));
    }

    /// <summary>Capsules about the T-pose: joint, two ends, radius of each; then what becomes of them.</summary>
    public static void Colliders(string file, string other)
    {
        GsacAvatar avatar = GsacLoader.Load(File.ReadAllBytes(file), "person");
        avatar.TPose();
        avatar.SkipFade();
        var colliders = avatar.gameObject.AddComponent<GsacColliders>();
        Action frame = Player.Frame(new[] { avatar.gameObject });
        frame();
        foreach (CapsuleCollider capsule in avatar.gameObject.GetComponentsInChildren<CapsuleCollider>(true))
        {
            Matrix4x4 m = capsule.transform.localToWorldMatrix;
            float half = capsule.height / 2 - capsule.radius;
            Vector3 a = m.MultiplyPoint3x4(new Vector3(0, -half, 0)), b = m.MultiplyPoint3x4(new Vector3(0, half, 0));
            Console.WriteLine(string.Format(CultureInfo.InvariantCulture, "{0} {1} {2} {3} {4} {5} {6} {7}", GsacColliders.JointOf(capsule), a.x, a.y, a.z, b.x, b.y, b.z, capsule.radius));
        }
        Func<int> count = () => avatar.gameObject.GetComponentsInChildren<CapsuleCollider>(true).Length;
        int before = count();
        frame();
        bool same = before == count();
        Transform pelvis = avatar.Joints[0];
        avatar.Use(File.ReadAllBytes(other));
        frame();
        int alive = 0, dead = 0;
        foreach (CapsuleCollider capsule in avatar.gameObject.GetComponentsInChildren<CapsuleCollider>(true))
        {
            if (capsule == null) dead++;
            else alive++;
        }
        colliders.Triggers = false;
        Console.WriteLine("kept " + same + " anew " + (alive == GsacCapsules.Fit(avatar.Data).Count) + " old gone " + (dead == before)
                          + " joint kept " + ReferenceEquals(pelvis, avatar.Joints[0]));
        Player.Call(colliders, "OnDisable");
        alive = 0;
        foreach (CapsuleCollider capsule in avatar.gameObject.GetComponentsInChildren<CapsuleCollider>(true)) alive += capsule == null ? 0 : 1;
        Console.WriteLine("off " + alive + " foreign " + (GsacColliders.JointOf(new GameObject("x").AddComponent<CapsuleCollider>()) ?? "nothing"));
    }

    /// <summary>args: address, digest or "-", most bytes, ...: what comes of each. The server's certificate is the test's own.</summary>
    public static void Addresses(string[] args)
    {
        ServicePointManager.ServerCertificateValidationCallback = (sender, certificate, chain, errors) => true;
        for (int i = 1; i < args.Length; i += 3)
        {
            try
            {
                byte[] bytes = GsacAddress.Read(new Uri(args[i], UriKind.RelativeOrAbsolute), args[i + 1] == "-" ? null : args[i + 1], long.Parse(args[i + 2]), CancellationToken.None);
                Console.WriteLine("read " + bytes.Length);
            }
            catch (Exception e)
            {
                Console.WriteLine(e.GetType().Name + " " + e.Message.Replace("\n", " "));
            }
        }
        var stop = new CancellationTokenSource(300);
        try
        {
            GsacAddress.Read(new Uri(args[1].Replace("/person.gsac", "/slow")), null, 1 << 20, stop.Token);
        }
        catch (OperationCanceledException)
        {
            Console.WriteLine("stopped");
        }
        var avatar = GsacLoader.LoadAsync(new Uri(args[1]), args[2]);
        avatar.Wait();
        Console.WriteLine(avatar.Result.name + " " + (avatar.Result.Data.JointCount == 55));
    }
}
